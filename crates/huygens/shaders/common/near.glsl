// The lists of near VPLs: a grid over the scene, for each cell the numbers of the VPLs that are near to points of it.
// `passes/near.rs` writes them.

uniform highp usampler2D s_near;

uvec4 near_texel(int k)
{
    return texelFetch(s_near, ivec2(k & 511, k >> 9), 0);
}

// Where the list for a point begins, and its end.
ivec2 near_range(vec3 position_ws)
{
    ivec3 cell = clamp(ivec3(floor((position_ws - near_grid.xyz) * near_grid.w)), ivec3(0), near_cells.xyz - 1);
    return ivec2(near_texel(cell.x + near_cells.x * (cell.y + near_cells.y * cell.z)).xy);
}

// The VPL at a place of the lists.
int near_vpl(int k)
{
    return int(near_texel(near_cells.w + (k >> 2))[k & 3]);
}
