// Depth pass of the shadow maps: the depth buffer alone is written.
void main() {}
