// Materials and light of all solid surfaces. program.py compiles a program for each MATERIAL (a number; the names of the
// materials are #defined as numbers too) and profile: with FAST defined for "fast", with FAST and GBUFFER for "gbuffer",
// which also stores what the light of a pixel was computed from. It also defines POLE_RADIUS, SKY_COLOR and the fields of
// lighting.py. Lengths are in metres. Numbers without an explanation were chosen by eye.
in vec3 world_position;
in vec3 world_normal;
in vec3 model_position;
in vec3 grain_direction;
layout(location = 0) out vec4 color;
#ifdef GBUFFER
layout(location = 1) out vec4 albedo_and_sunlight;  // square root of the albedo; share of the sunlight
layout(location = 2) out vec4 encoded_normal;       // -1 to 1 as 1 to 255; 0 as 128, where the ball casts no shadow
#endif
uniform sampler2D sun_map;    // variance shadow map of the sun: mean and mean square of the depth, blurred
uniform sampler2D sky_map;    // the same for a light straight above, with a wider blur
uniform sampler2D detail;     // texture of the material, grey
uniform samplerCube dimples;  // texture of the ball: normal in rgb; a: white (1) or red (0)
uniform mat4 model;
uniform vec4 tint;            // sRGB colour that replaces the hue of the material; w: 1 with tint, 0 without

// Return the share of a light that reaches p, by its variance shadow map (W. Donnelly and A. Lauritzen, "Variance Shadow
// Maps", 2006): Chebyshev's bound on the share of depths around p that are greater than that of p.
// max_depth: depth of the far plane (no occluder). min_variance: variance of a flat surface, against self-shadowing.
// fade: rate at which a shadow weakens with the distance to its occluder, per metre. min_share: shares below it count
// as 0, against light bleeding.
float light_share(
    sampler2D map, mat4 from_world, vec3 p, float max_depth, float min_variance, float fade, float min_share
) {
    vec3 at = (from_world * vec4(p, 1.0)).xyz;
    vec2 moments = texture(map, at.xy).rg;
    float behind = max(min(at.z, max_depth) - moments.x, 0.0);
    float variance = max(moments.y - moments.x * moments.x, min_variance);
    float shadow = 1.0 - smoothstep(min_share, 1.0, variance / (variance + behind * behind));
    return 1.0 - shadow * exp(-fade * behind);
}

// Return the share of the sun's disc that the ball does not hide from p.
float sun_past_ball(vec3 p) {
    vec3 to_ball = ball.xyz - p;
    float along = dot(to_ball, SUN_DIRECTION);
    if (along < 0.0) return 1.0;
    float off_axis = sqrt(max(dot(to_ball, to_ball) - along * along, 0.0));
    float penumbra = PENUMBRA_GROWTH * along + CONTACT_PENUMBRA * ball.w;
    return smoothstep(ball.w - penumbra, ball.w + penumbra, off_axis);
}

// Return the share of the sun's disc that the flag does not hide from p: the ray to the sun meets the plane of pole and
// cloth at q.
float sun_past_flag(vec3 p) {
    vec2 across = vec2(-cloth.y, cloth.x);
    float t = dot(flag.xy - p.xy, across) / dot(SUN_DIRECTION.xy, across);
    vec3 q = p + t * SUN_DIRECTION - flag.xyz;
    float penumbra = 0.004 + 0.02 * max(t, 0.0);  // narrower than the ball's, as the pole is thin
    float s = dot(q.xy, cloth.xy);  // distance from the pole along the cloth
    float pole = 1.0 - smoothstep(-penumbra, penumbra, abs(s) - POLE_RADIUS);
    pole *= POLE_RADIUS / max(POLE_RADIUS, penumbra);  // a pole narrower than the penumbra hides only a part
    float drop = flag.w - q.z;      // distance below the top of the pole
    float half_width = 0.5 * cloth.w * (1.0 - s / cloth.z);
    float sheet = 1.0 - smoothstep(-penumbra, penumbra, abs(drop - 0.5 * cloth.w) - half_width);
    sheet *= smoothstep(-penumbra, penumbra, s);
    float is_on_flag = step(0.0, t) * step(0.0, q.z) * step(0.0, drop + penumbra);
    return 1.0 - is_on_flag * max(pole, sheet);
}

// Mean brightness of the material, which a tint keeps.
#if MATERIAL == FELT
const float MEAN_BRIGHTNESS = 0.17;
#elif MATERIAL == WOOD
const float MEAN_BRIGHTNESS = 0.26;
#elif MATERIAL == STONE || MATERIAL == BRICK
const float MEAN_BRIGHTNESS = 0.40;
#elif MATERIAL == WATER
const float MEAN_BRIGHTNESS = 0.14;
#else
const float MEAN_BRIGHTNESS = 0.75;
#endif

// Return the grey value of the material's texture.
float detail_at(vec2 uv) { return texture(detail, uv).r; }

void main() {
    float opacity = 1.0;
#if MATERIAL == MARKER || MATERIAL == MARKER_GHOST
    // A disc with a soft edge that faces the camera, shaded and with the depth of a sphere. model_position: in radii.
    float radius = length(model_position.xy);
    float pixels_per_radius = 1.0 / length(vec2(dFdx(model_position.x), dFdy(model_position.x)));
    opacity = clamp((1.0 - radius) * pixels_per_radius + 0.5, 0.0, 1.0);
    vec3 on_sphere = vec3(model_position.xy, sqrt(max(1.0 - radius * radius, 0.0)));
    vec4 clip = clip_from_world * vec4(world_position + model[2].xyz * on_sphere.z, 1.0);
    gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
#endif
#if MATERIAL == GHOST || MATERIAL == MARKER_GHOST
    color = vec4(1.0, 1.0, 1.0, GHOST_OPACITY * opacity);  // the ball where something hides it
    return;
#endif
    // Albedo, normal and gloss of the material.
    vec3 p = world_position;
    vec3 n = normalize(world_normal);
    vec3 albedo = vec3(0.8);
    float gloss = 0.0;
    float sharpness = 32.0;
    vec3 view = normalize(eye.xyz - p);
#if MATERIAL == FELT
    // Mown stripes of 0.22 m, lighter or darker as the fibres lean. Steep faces are brown.
    float stripe = smoothstep(-0.08, 0.08, sin(p.x * (PI / 0.22)));
    float fibre_noise = detail_at(p.xy * 1.9);
    albedo = mix(vec3(0.062, 0.235, 0.050), vec3(0.090, 0.300, 0.066), stripe);
    albedo *= 0.55 + 0.9 * fibre_noise;
    if (n.z < 0.05) albedo = vec3(0.16, 0.13, 0.10) * (0.6 + 0.8 * detail_at(vec2(p.x + p.y, p.z) * 1.9));
#elif MATERIAL == LAWN
    // A diagonal mowing pattern.
    float noise = detail_at(p.xy * 0.43);
    float weave = sin((p.x + p.y) * (PI / 0.9)) * sin((p.x - p.y) * (PI / 0.9));
    albedo = vec3(0.150, 0.255, 0.085) * (0.5 + noise) * (1.0 + 0.07 * smoothstep(-0.2, 0.2, weave));
#elif MATERIAL == WOOD
    // The texture is stretched along the grain.
    vec3 along = normalize(grain_direction);
    vec3 side = cross(n, along);
    vec2 board = vec2(dot(p, along), dot(p, side));
    float ring = detail_at(vec2(board.x * 0.55, board.y * 2.6));
    albedo = mix(vec3(0.285, 0.135, 0.052), vec3(0.560, 0.330, 0.150), ring);
    gloss = 0.25;
#elif MATERIAL == STONE
    // Triplanar mapping: three projections, weighted by the normal.
    vec3 weight = n * n;
    float cloud = detail_at(p.yz * 1.7) * weight.x + detail_at(p.xz * 1.7) * weight.y + detail_at(p.xy * 1.7) * weight.z;
    albedo = vec3(0.52, 0.50, 0.47) * (0.35 + 1.2 * cloud);
    gloss = 0.12;
#elif MATERIAL == WALL
    // Panels of 0.5 m.
    vec2 across = abs(n.z) > 0.7 ? p.xy : vec2(abs(n.x) > 0.7 ? p.y : p.x, p.z);
    vec2 seam = abs(fract(across * 2.0 + 0.5) - 0.5);
    albedo = vec3(0.70, 0.66, 0.60) * (0.82 + 0.18 * smoothstep(0.0, 0.02, min(seam.x, seam.y)));
#elif MATERIAL == CUP
    albedo = vec3(0.86);
    // Darker down to 1.3 radii below the rim.
    if (cup.w > 0.0) albedo *= mix(0.10, 1.0, smoothstep(-1.3 * cup.w, 0.0, p.z - cup.z));
    gloss = 0.2;
#elif MATERIAL == BRICK
    // Rows of 65 mm, bricks of 200 mm, mortar of 8 mm.
    vec2 wall = abs(n.z) > 0.7 ? p.xy : vec2(abs(n.x) > abs(n.y) ? p.y : p.x, p.z);
    vec2 cell = vec2(wall.x / 0.20, wall.y / 0.065);
    cell.x += 0.5 * mod(floor(cell.y), 2.0);
    vec2 brick = fract(cell);
    vec2 edge = min(brick, 1.0 - brick) * vec2(0.20, 0.065);
    // A random tone for each brick, by the usual hash of a sine.
    float brick_tone = fract(sin(dot(floor(cell), vec2(12.9898, 78.233))) * 43758.5453);
    float mortar = smoothstep(0.003, 0.005, min(edge.x, edge.y));
    albedo = mix(vec3(0.50, 0.47, 0.42), mix(vec3(0.36, 0.105, 0.060), vec3(0.50, 0.19, 0.11), brick_tone), mortar);
    albedo *= 0.7 + 0.6 * detail_at(wall * 1.7);
#elif MATERIAL == PAINT
    albedo = vec3(0.75);
    gloss = 0.25;
#elif MATERIAL == WATER
    // Ripples tilt the normal; the sky is reflected at grazing angles.
    float ripple = detail_at(p.xy * 0.9) - detail_at(p.yx * 1.3 + 0.37);
    n = normalize(n + vec3(0.20 * ripple, 0.16 * ripple, 0.0));
    albedo = vec3(0.030, 0.170, 0.260) * (1.0 + 0.5 * ripple);
    albedo += SKYLIGHT * 0.5 * pow(1.0 - max(dot(n, view), 0.0), 3.0);
    gloss = 0.3;
    sharpness = 90.0;
#elif MATERIAL == CLOTH
    if (dot(n, view) < 0.0) n = -n;
    albedo = vec3(0.80, 0.045, 0.035);
#elif MATERIAL == POLE
    // White and red bands of 8 cm.
    albedo = mix(vec3(0.85), vec3(0.80, 0.05, 0.04), step(0.5, fract(model_position.z / 0.16)));
    gloss = 0.4;
#elif MATERIAL == BALL
    vec4 skin = texture(dimples, model_position);
    n = normalize(mix(n, normalize(mat3(model) * (skin.rgb * 2.0 - 1.0)), 0.8));
    albedo = mix(vec3(0.80, 0.10, 0.06), vec3(0.93), skin.a);
    gloss = 0.5;
    sharpness = 60.0;
#elif MATERIAL == MARKER
    n = normalize(mat3(model) * on_sphere);
    albedo = vec3(MARKER_ALBEDO);
#endif
#if MATERIAL <= WATER && MATERIAL != LAWN
    // A tint replaces the colour and keeps the pattern of lighter and darker spots.
    if (tint.w > 0.0) albedo = tint.rgb * tint.rgb * (dot(albedo, vec3(0.3, 0.6, 0.1)) / MEAN_BRIGHTNESS);
#endif
    // Shares of the sun's direct light and of the ambient light that reach the surface.
    float direct = max(dot(n, SUN_DIRECTION), 0.0);
    float ambient_share = 1.0;
#if MATERIAL == BALL || MATERIAL == MARKER
    ambient_share = mix(MIN_BALL_AMBIENT, 1.0, smoothstep(-1.0, 0.6, n.z));
#endif
#if MATERIAL != CLOTH && MATERIAL != POLE && MATERIAL != MARKER
    // The offset along the normal prevents self-shadowing.
    direct *= light_share(sun_map, sun_from_world, p + n * 0.004, ground.z, 1e-5, 0.0, 0.15);
#if MATERIAL != BALL && MATERIAL != LAWN
    direct *= sun_past_ball(p);
    // Ambient occlusion by the ball, which ends at a distance of OCCLUSION_RANGE radii.
    vec3 to_ball = ball.xyz - p;
    float distance_sq = dot(to_ball, to_ball);
    float solid_angle = clamp(ball.w * ball.w / distance_sq - 1.0 / (OCCLUSION_RANGE * OCCLUSION_RANGE), 0.0, 1.0);
    float occlusion = solid_angle * clamp(dot(n, to_ball) * inversesqrt(distance_sq), 0.0, 1.0);
    ambient_share = 1.0 - OCCLUSION_STRENGTH * occlusion;
#endif
#if MATERIAL != LAWN
    if (flag.w > 0.0) direct *= sun_past_flag(p);
#endif
#ifndef FAST
    ambient_share *= mix(0.1, 1.0, light_share(sky_map, sky_from_world, p + n * 0.01, ground.w, 2e-4, 2.5, 0.4));
#endif
#endif
    // Diffuse light, specular reflection of the sun, and haze.
    vec3 ambient = mix(GROUNDLIGHT, SKYLIGHT, 0.5 + 0.5 * n.z) * ambient_share;
    vec3 lit = albedo * (SUNLIGHT * direct + ambient);
#ifndef FAST
    if (gloss > 0.0) {
        vec3 halfway = normalize(view + SUN_DIRECTION);
        lit += SUNLIGHT * (gloss * direct * pow(max(dot(n, halfway), 0.0), sharpness));
    }
#endif
#if MATERIAL == LAWN
    lit = mix(lit, SKY_COLOR * SKY_COLOR, smoothstep(1.5, 7.0, length(p.xy - center.xy) / ground.y));
#endif
    // Tone mapping, which compresses bright colours, then gamma 2.
    lit = lit * (1.0 + lit * TONE_GAIN) / (1.0 + lit * TONE_COMPRESSION);
    color = vec4(sqrt(lit), opacity);
#ifdef GBUFFER
#if MATERIAL == LAWN || MATERIAL == CLOTH || MATERIAL == POLE
    n = vec3(0.0);
#endif
    albedo_and_sunlight = vec4(sqrt(albedo) / MAX_ROOT_ALBEDO, direct);
    encoded_normal = vec4((n * 127.0 + 128.0) / 255.0, 1.0);
#endif
}
