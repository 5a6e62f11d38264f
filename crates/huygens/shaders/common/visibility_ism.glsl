// Visibility from imperfect shadow maps (Ritschel et al. 2008): one octahedral tile of the atlas for each VPL.
// map: x: texels on a tile's edge, y: tiles in a row, z: farthest distance that the maps hold (m), w: half the
// diagonal of the widest texel of a sphere as an angle.

uniform sampler2D s_ism;

// The receiver is moved along its normal by d · δ · sin ϑ, δ half the diagonal of a texel and ϑ the angle of
// incidence: on a plane, where splats have the plane's own depth, that keeps the plane from shadowing itself. The
// slack, a share of d, is for texels that lie across an edge: docs/technique.md has what was tried.
float vpl_visibility(int index, Vpl vpl, Surface s)
{
    vec3 d = s.position_ws - vpl.position_ws;
    // √2 times as many texels in a radian.
    float half_diagonal = map.w * (vpl.lambertian ? 0.70710678 : 1.0);
    float along = dot(s.geometric_normal_ws, d);
    d += s.geometric_normal_ws * (sqrt(max(dot(d, d) - along * along, 0.0)) * half_diagonal);
    mat3 to_tile = tile_from_world(vpl.direction_ws, vpl.lambertian);
    int size = int(map.x), columns = int(map.y), row = int((float(index) + 0.5) / map.y);
    ivec2 texel = clamp(ivec2(tile_encode(to_tile * d, vpl.lambertian) * map.x), ivec2(0), ivec2(size - 1));
    texel += ivec2(index - row * columns, row) * size;
    float nearest = texelFetch(s_ism, texel, 0).r * map.z;
    float slack = clamp(0.056, 0.6 * half_diagonal, 1.2 * half_diagonal);
    return length(d) * (1.0 - slack) <= nearest ? 1.0 : 0.0;
}
