// No object moved since the frame before: for programs that are used only then. (llvmpipe runs a branch that no pixel takes,
// and reading motions takes a fifth of the time of the means.)

void to_before(ivec2 pixel, inout vec3 position, inout vec3 normal, inout vec3 plane) {}
