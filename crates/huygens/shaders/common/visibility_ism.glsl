// Visibility from imperfect shadow maps (Ritschel et al. 2008): one octahedral tile of the atlas for each VPL.
// map: x: texels on a tile's edge, y: tiles in a row, z: farthest distance that the maps hold (m), w: half the
// diagonal of a texel as an angle.

uniform sampler2D s_ism;

// The receiver is moved along its normal by the distance that half a texel's diagonal spans there: on a plane, where
// splats have the plane's own depth, that keeps the plane from shadowing itself.
float vpl_visibility(int index, vec3 vpl_ws, vec3 position_ws, vec3 normal_ws)
{
    vec3 d = position_ws - vpl_ws;
    d += normal_ws * (length(d) * map.w);
    int size = int(map.x), columns = int(map.y);
    ivec2 texel = clamp(ivec2((oct_encode(d) * 0.5 + 0.5) * map.x), ivec2(0), ivec2(size - 1));
    texel += ivec2(index % columns, index / columns) * size;
    float nearest = texelFetch(s_ism, texel, 0).r;
    return length(d) * (1.0 - map.w * 0.25) <= nearest * map.z ? 1.0 : 0.0;
}
