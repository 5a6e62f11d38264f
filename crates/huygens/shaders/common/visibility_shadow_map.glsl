// Visibility from regular shadow maps: the six faces of each VPL's cube stand 3 × 2 in an atlas.
// map: x: texels on a face's edge, y: cubes in a row, z: 1 / farthest distance that the maps hold.

uniform highp sampler2D s_atlas;

float vpl_visibility(int index, Vpl vpl, Surface s)
{
    vec3 d = s.position_ws - vpl.position_ws;
    vec3 middle = receiver_center(d, s.geometric_normal_ws, 1.4 / map.x);
    vec3 a = abs(middle);
    // OpenGL's table of cube map faces: face, and the axes on it.
    int face;
    vec3 u, v;
    if (a.x >= a.y && a.x >= a.z) {
        face = middle.x > 0.0 ? 0 : 1;
        u = vec3(0.0, 0.0, -sign(middle.x)), v = vec3(0.0, -1.0, 0.0);
    } else if (a.y >= a.z) {
        face = middle.y > 0.0 ? 2 : 3;
        u = vec3(1.0, 0.0, 0.0), v = vec3(0.0, 0.0, sign(middle.y));
    } else {
        face = middle.z > 0.0 ? 4 : 5;
        u = vec3(sign(middle.z), 0.0, 0.0), v = vec3(0.0, -1.0, 0.0);
    }
    vec3 ray = middle / max(a.x, max(a.y, a.z));
    vec2 p = vec2(dot(ray, u), dot(ray, v));
    int size = int(map.x), columns = int(map.y), cube = index - int(range.z);
    ivec2 texel = clamp(ivec2((p * 0.5 + 0.5) * map.x), ivec2(0), ivec2(size - 1));
    // The map was drawn through the middle of the texel.
    p = (vec2(texel) + 0.5) / map.x * 2.0 - 1.0 - p;
    ray += u * p.x + v * p.y;
    texel += ivec2((cube % columns) * 3 + face % 3, (cube / columns) * 2 + face / 3) * size;
    float reference = receiver_distance(d, s.geometric_normal_ws, normalize(ray)) * map.z;
    return reference <= texelFetch(s_atlas, texel, 0).r ? 1.0 : 0.0;
}
