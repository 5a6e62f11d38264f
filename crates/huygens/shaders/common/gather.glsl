// Parameters of the sum over the VPLs. `passes/gather.rs` mirrors the block.

layout(std140) uniform PassBlock {
    uvec4 range; // x: first VPL, y: how many, z: index of the first one's shadow map
    vec4 map;    // what the visibility needs, see its file
};
