// Visibility from regular shadow maps: the six faces of each VPL's cube stand 3 × 2 in an atlas.
// map: x: texels on a face's edge, y: cubes in a row, z: 1 / farthest distance that the maps hold, w: half the
// diagonal of a texel as an angle.

uniform highp sampler2D s_atlas;

float vpl_visibility(int index, Vpl vpl, Surface s)
{
    vec3 d = s.position_ws - vpl.position_ws;
    d += s.geometric_normal_ws * (length(d) * (map.w + 1e-4));
    vec3 a = abs(d);
    // OpenGL's table of cube map faces: face, and coordinates on it.
    int face;
    vec2 p;
    if (a.x >= a.y && a.x >= a.z) {
        face = d.x > 0.0 ? 0 : 1;
        p = vec2(d.x > 0.0 ? -d.z : d.z, -d.y) / a.x;
    } else if (a.y >= a.z) {
        face = d.y > 0.0 ? 2 : 3;
        p = vec2(d.x, d.y > 0.0 ? d.z : -d.z) / a.y;
    } else {
        face = d.z > 0.0 ? 4 : 5;
        p = vec2(d.z > 0.0 ? d.x : -d.x, -d.y) / a.z;
    }
    int size = int(map.x), columns = int(map.y), cube = index - int(range.z);
    ivec2 texel = clamp(ivec2((p * 0.5 + 0.5) * map.x), ivec2(0), ivec2(size - 1));
    texel += ivec2((cube % columns) * 3 + face % 3, (cube / columns) * 2 + face / 3) * size;
    return length(d) * map.z <= texelFetch(s_atlas, texel, 0).r ? 1.0 : 0.0;
}
