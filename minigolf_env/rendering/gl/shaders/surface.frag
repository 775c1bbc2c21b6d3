// Light on everything solid. A program is compiled for each MATERIAL (a number, see gl_renderer.py).
in vec3 place;
in vec3 facing;
in vec3 own;
in vec3 fibre;
out vec4 color;
uniform sampler2D sun_map;   // mean and mean square of the depth below the sun, blurred
uniform sampler2D sky_map;   // the same, straight down, blurred wider
uniform sampler2D detail;    // the material's texture, grey
uniform samplerCube dimples;
uniform mat4 model;
uniform vec4 dye;            // sRGB, and whether the material has it instead of its own colour

// The share of light that reaches a depth, from the mean and mean square of the depths that stop it around there
// (W. Donnelly and A. Lauritzen, "Variance Shadow Maps", 2006); `least` is the variance of a flat surface, `fade` how
// fast a shadow gets weaker with the distance from what throws it, a metre; a share below `dark` is none.
float visible(sampler2D map, mat4 from_world, vec3 p, float furthest, float least, float fade, float dark) {
    vec3 at = (from_world * vec4(p, 1.0)).xyz;
    vec2 moments = texture(map, at.xy).rg;
    float behind = max(min(at.z, furthest) - moments.x, 0.0);
    float variance = max(moments.y - moments.x * moments.x, least);
    float stopped = 1.0 - smoothstep(dark, 1.0, variance / (variance + behind * behind));
    return 1.0 - stopped * exp(-fade * behind);
}

// The share of the sun's disc that the ball leaves visible from p.
float past_ball(vec3 p) {
    vec3 way = ball.xyz - p;
    float along = dot(way, sun.xyz);
    if (along < 0.0) return 1.0;
    float aside = sqrt(max(dot(way, way) - along * along, 0.0));
    float blur = 0.08 * along + 0.04 * ball.w;
    return smoothstep(ball.w - blur, ball.w + blur, aside);
}

// The same for the flag: the sun's ray meets the plane of pole and cloth.
float past_flag(vec3 p) {
    vec2 across = vec2(-cloth.y, cloth.x);
    float t = dot(flag.xy - p.xy, across) / dot(sun.xy, across);
    vec3 q = p + t * sun.xyz - flag.xyz;
    float blur = 0.004 + 0.02 * max(t, 0.0);
    float s = dot(q.xy, cloth.xy);
    float pole = 1.0 - smoothstep(-blur, blur, abs(s) - 0.006);
    pole *= 0.006 / max(0.006, blur);
    float drop = flag.w - q.z;   // below the top of the pole
    float half_width = 0.5 * cloth.w * (1.0 - s / cloth.z);
    float sheet = 1.0 - smoothstep(-blur, blur, abs(drop - 0.5 * cloth.w) - half_width);
    sheet *= smoothstep(-blur, blur, s);
    float there = step(0.0, t) * step(0.0, q.z) * step(0.0, drop + blur);
    return 1.0 - there * max(pole, sheet);
}

// Brightness of a material's middle tone.
#if MATERIAL == FELT
const float TONE = 0.17;
#elif MATERIAL == WOOD
const float TONE = 0.26;
#elif MATERIAL == STONE || MATERIAL == BRICK
const float TONE = 0.40;
#elif MATERIAL == WATER
const float TONE = 0.14;
#else
const float TONE = 0.75;
#endif

float speckle(vec2 uv) { return texture(detail, uv).r; }

void main() {
#if MATERIAL == GHOST
    color = vec4(1.0, 1.0, 1.0, 0.3);  // The ball, seen through what is in front of it.
    return;
#endif
    vec3 n = normalize(facing);
    vec3 albedo = vec3(0.8);
    float gloss = 0.0;
    float sharpness = 32.0;
    vec3 view = normalize(eye.xyz - place);
#if MATERIAL == FELT
    // Mown in stripes; the fibres shine towards or away from the eye.
    float stripe = smoothstep(-0.08, 0.08, sin(place.x * (PI / 0.22)) );
    float fibre_noise = speckle(place.xy * 1.9);
    albedo = mix(vec3(0.062, 0.235, 0.050), vec3(0.090, 0.300, 0.066), stripe);
    albedo *= 0.55 + 0.9 * fibre_noise;
    if (n.z < 0.05) albedo = vec3(0.16, 0.13, 0.10) * (0.6 + 0.8 * speckle(vec2(place.x + place.y, place.z) * 1.9));
#elif MATERIAL == LAWN
    float noise = speckle(place.xy * 0.43);
    float weave = sin((place.x + place.y) * (PI / 0.9)) * sin((place.x - place.y) * (PI / 0.9));
    albedo = vec3(0.150, 0.255, 0.085) * (0.5 + noise) * (1.0 + 0.07 * smoothstep(-0.2, 0.2, weave));
#elif MATERIAL == WOOD
    vec3 along = normalize(fibre);
    vec3 side = cross(n, along);
    vec2 board = vec2(dot(place, along), dot(place, side));
    float ring = speckle(vec2(board.x * 0.55, board.y * 2.6));
    albedo = mix(vec3(0.285, 0.135, 0.052), vec3(0.560, 0.330, 0.150), ring);
    gloss = 0.25;
#elif MATERIAL == STONE
    vec3 weight = n * n;
    float cloud = speckle(place.yz * 1.7) * weight.x + speckle(place.xz * 1.7) * weight.y + speckle(place.xy * 1.7) * weight.z;
    albedo = vec3(0.52, 0.50, 0.47) * (0.35 + 1.2 * cloud);
    gloss = 0.12;
#elif MATERIAL == WALL
    // Panels of half a metre.
    vec2 across = abs(n.z) > 0.7 ? place.xy : vec2(abs(n.x) > 0.7 ? place.y : place.x, place.z);
    vec2 seam = abs(fract(across * 2.0 + 0.5) - 0.5);
    albedo = vec3(0.70, 0.66, 0.60) * (0.82 + 0.18 * smoothstep(0.0, 0.02, min(seam.x, seam.y)));
#elif MATERIAL == CUP
    albedo = vec3(0.86);
    if (cup.w > 0.0) albedo *= mix(0.10, 1.0, smoothstep(-1.3 * cup.w, 0.0, place.z - cup.z));
    gloss = 0.2;
#elif MATERIAL == BRICK
    // Courses of 65 mm, bricks of 200 mm, mortar of 8 mm.
    vec2 wall = abs(n.z) > 0.7 ? place.xy : vec2(abs(n.x) > abs(n.y) ? place.y : place.x, place.z);
    vec2 course = vec2(wall.x / 0.20, wall.y / 0.065);
    course.x += 0.5 * mod(floor(course.y), 2.0);
    vec2 brick = fract(course), edge = min(brick, 1.0 - brick) * vec2(0.20, 0.065);
    float each = fract(sin(dot(floor(course), vec2(12.9898, 78.233))) * 43758.5453);
    float mortar = smoothstep(0.003, 0.005, min(edge.x, edge.y));
    albedo = mix(vec3(0.50, 0.47, 0.42), mix(vec3(0.36, 0.105, 0.060), vec3(0.50, 0.19, 0.11), each), mortar);
    albedo *= 0.7 + 0.6 * speckle(wall * 1.7);
#elif MATERIAL == PAINT
    albedo = vec3(0.75);
    gloss = 0.25;
#elif MATERIAL == WATER
    float ripple = speckle(place.xy * 0.9) - speckle(place.yx * 1.3 + 0.37);
    n = normalize(n + vec3(0.20 * ripple, 0.16 * ripple, 0.0));
    albedo = vec3(0.030, 0.170, 0.260) * (1.0 + 0.5 * ripple);
    albedo += SKYLIGHT * 0.5 * pow(1.0 - max(dot(n, view), 0.0), 3.0);
    gloss = 0.3;
    sharpness = 90.0;
#elif MATERIAL == CLOTH
    if (dot(n, view) < 0.0) n = -n;
    albedo = vec3(0.80, 0.045, 0.035);
#elif MATERIAL == POLE
    albedo = mix(vec3(0.85), vec3(0.80, 0.05, 0.04), step(0.5, fract(own.z / 0.16)));
    gloss = 0.4;
#elif MATERIAL == BALL
    vec4 skin = texture(dimples, own);
    n = normalize(mix(n, normalize(mat3(model) * (skin.rgb * 2.0 - 1.0)), 0.8));
    albedo = mix(vec3(0.80, 0.10, 0.06), vec3(0.93), skin.a);
    gloss = 0.5;
    sharpness = 60.0;
#endif
#if MATERIAL <= WATER && MATERIAL != LAWN
    // The dye keeps the pattern: lighter and darker than the material's middle tone.
    if (dye.w > 0.0) albedo = dye.rgb * dye.rgb * (dot(albedo, vec3(0.3, 0.6, 0.1)) / TONE);
#endif
    float toward = max(dot(n, sun.xyz), 0.0);
    float direct = toward;
    float open = 1.0;
#if MATERIAL != CLOTH && MATERIAL != POLE
    direct *= visible(sun_map, sun_from_world, place + n * 0.004, ground.z, 1e-5, 0.0, 0.15);
#if MATERIAL != BALL && MATERIAL != LAWN
    direct *= past_ball(place);
    vec3 way = ball.xyz - place;
    float near = dot(way, way);
    // Ends at four radii: moving.py counts on it.
    float cover = clamp(ball.w * ball.w / near - 1.0 / 16.0, 0.0, 1.0) * clamp(dot(n, way) * inversesqrt(near), 0.0, 1.0);
    open = 1.0 - 0.85 * cover;
#elif MATERIAL == BALL
    open = 0.55 + 0.45 * smoothstep(-1.0, 0.6, n.z);
#endif
#if MATERIAL != LAWN
    if (flag.w > 0.0) direct *= past_flag(place);
#endif
#ifndef FAST
    open *= mix(0.1, 1.0, visible(sky_map, sky_from_world, place + n * 0.01, ground.w, 2e-4, 2.5, 0.4));
#endif
#endif
    vec3 ambient = mix(BOUNCED, SKYLIGHT, 0.5 + 0.5 * n.z) * open;
    vec3 lit = albedo * (SUNLIGHT * direct + ambient);
#ifndef FAST
    if (gloss > 0.0) {
        vec3 middle = normalize(view + sun.xyz);
        lit += SUNLIGHT * (gloss * direct * pow(max(dot(n, middle), 0.0), sharpness));
    }
#endif
#if MATERIAL == LAWN
    lit = mix(lit, HAZE * HAZE, smoothstep(1.5, 7.0, length(place.xy - middle.xy) / ground.y));
#endif
    lit = lit * (1.0 + lit * 0.12) / (1.0 + lit * 0.55);  // Bright parts are rolled off.
    color = vec4(sqrt(lit), 1.0);
}
