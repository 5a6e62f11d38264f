// The camera. `passes/mod.rs` mirrors the block.

layout(std140) uniform FrameBlock {
    mat4 view_from_world;
    mat4 clip_from_view;
    mat4 world_from_view;
    vec4 eye_ws;       // position of the camera, m; w = 1 for a perspective camera, 0 for a parallel one
    vec4 forward_ws;   // unit vector of sight
    vec4 unprojection; // xy: scale, z: a, w: b in xy_vs = ndc · scale · (a + b · depth)
    vec4 jitter;       // xy: offset of the sample from the pixel's centre, in NDC; z: 1 / farthest depth, 1/m
    vec4 size;         // xy: pixels, zw: their inverses
};
