// Parameters of the sum over the VPLs. `passes/gather.rs` mirrors the block.

layout(std140) uniform PassBlock {
    uvec4 range; // x: first VPL, y: where they end, z: index of the first one's shadow map, w: bits: 1 the glossy lobe too, 2 those in lists only where not near
    vec4 map;    // what the visibility needs, see its file
    ivec4 grid;  // x: n, y: pixels from one that takes part to the next, zw: size of a layer of the target
    uvec4 turn;  // xy: what places change by in this frame, z: number of subsets, w: which of its subsets a place has in this frame
    vec4 near_grid;    // see near.glsl: xyz: corner of the grid, m; w: cells per m
    vec4 near_scale;   // xy: reciprocals of the size of the lists' texture
    ivec4 near_cells;  // xyz: cells along each axis, w: 1 if what is summed is added to what there is, else it is all
};

// Roughness α of a lobe in which a VPL stands for a disc of radius √bound2 at distance √d2: wide enough that it runs into
// the next ones.
float widened_alpha(float alpha, float bound2, float d2)
{
    return min(sqrt(alpha * alpha + 2.0 * bound2 / max(d2, 1e-36)), 1.0);
}

// Which subset of the VPLs a place in the n × n has: places next to one another have subsets far apart in the order of
// the VPLs, so that every 2^k × 2^k of them see all of the scene alike. Where there are more than n² subsets, each place
// has those that follow one another in turn.
int subset_of(uvec2 place)
{
    uint n = uint(grid.x), subset = 0u;
    place ^= turn.xy;
    for (uint bit = 1u; bit < n; bit *= 2u) {
        subset = 4u * subset + uint((place.x & bit) != 0u) + 2u * uint((place.y & bit) != 0u);
    }
    return int(subset * (turn.z / (n * n)) + turn.w);
}
