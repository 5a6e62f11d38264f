// Parameters of the sum over the VPLs. `passes/gather.rs` mirrors the block.

layout(std140) uniform PassBlock {
    uvec4 range; // x: first VPL, y: where they end, z: index of the first one's shadow map, w: 1 for the glossy lobe too
    vec4 map;    // what the visibility needs, see its file
    ivec4 layer; // xy: where the layer of pixels that the range is for begins in the target, z: pixels from one of it to the next, w: VPLs from one to the next
    ivec4 first_pixel; // xy: the first pixel of the layer
};

// Roughness α of a lobe in which a VPL stands for a disc of radius √bound2 at distance √d2: wide enough that it runs into
// the next ones.
float widened_alpha(float alpha, float bound2, float d2)
{
    return min(sqrt(alpha * alpha + 2.0 * bound2 / max(d2, 1e-36)), 1.0);
}
