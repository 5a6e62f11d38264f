// One light. `passes/direct.rs` mirrors the block.

layout(std140) uniform PassBlock {
    mat4 light_from_world; // to the light's own space (cube map), or to texture space and depth (parallel rays)
    vec4 light_position;   // xyz: m; w: profile: 0 uniform, 1 cosine, 2 spot, 3 point, 4 directional
    vec4 light_axis;       // xyz: unit vector that the light faces; w: scale of the cone
    vec4 light_intensity;  // rgb: W/sr (directional: W/m²); a: offset of the cone
    vec4 shadow;           // cube: 1 / far, texel's angle, filter radius in texels, -
                           // parallel: 1 / texels, texel's size in m, filter radius in texels, offset in m
};
