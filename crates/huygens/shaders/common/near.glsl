// The lists of near VPLs: a grid over the scene, for each cell and axis the numbers of the VPLs that are near to surfaces
// in the cell whose normals are along the axis. `passes/near.rs` writes them.

uniform highp usampler2D s_near;

uvec4 near_texel(int k)
{
    return texelFetch(s_near, ivec2(k & 511, k >> 9), 0);
}

// The VPL at a place of the lists.
int near_vpl(int k)
{
    return int(near_texel(near_cells.w + (k >> 2))[k & 3]);
}

// Where the list for a point of a surface begins, and its end.
ivec2 near_range(vec3 position_ws, vec3 geometric_normal_ws)
{
    ivec3 cell = clamp(ivec3(floor((position_ws - near_grid.xyz) * near_grid.w)), ivec3(0), near_cells.xyz - 1);
    vec3 a = abs(geometric_normal_ws);
    int axis = a.x >= max(a.y, a.z) ? 0 : a.y >= a.z ? 1 : 2;
    int start = int(near_texel(cell.x + near_cells.x * (cell.y + near_cells.y * cell.z))[axis]);
    return start + 1 + ivec2(0, near_vpl(start));
}
