// The map of a VPL's tile in an atlas of imperfect shadow maps: octahedral over the sphere, or over the hemisphere in
// front of a VPL that has nothing behind it (Cigolle et al. 2014, "A survey of efficient representations for
// independent unit vectors": hemi-oct), which gives a direction twice the texels.

// From world space to the space of the tile; a hemisphere is around its z axis.
mat3 tile_from_world(vec3 direction_ws, bool hemisphere)
{
    if (!hemisphere) {
        return mat3(1.0);
    }
    vec3 x = normalize(cross(abs(direction_ws.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0), direction_ws));
    return transpose(mat3(x, cross(direction_ws, x), direction_ws));
}

// To 0…1. What is behind a hemisphere goes to its rim.
vec2 tile_encode(vec3 d, bool hemisphere)
{
    vec2 p = d.xy / (abs(d.x) + abs(d.y) + max(d.z, 0.0));
    return (hemisphere ? vec2(p.x + p.y, p.x - p.y) : oct_encode(d)) * 0.5 + 0.5;
}

vec3 tile_decode(vec2 at, bool hemisphere)
{
    vec2 p = at * 2.0 - 1.0, q = 0.5 * vec2(p.x + p.y, p.x - p.y);
    return hemisphere ? normalize(vec3(q, 1.0 - abs(q.x) - abs(q.y))) : oct_decode(p);
}
