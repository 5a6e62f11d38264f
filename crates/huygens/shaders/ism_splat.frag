// One texel of a splat: the texel's ray from the VPL meets the surfel's disc. Output: distance over the farthest.

layout(std140) uniform PassBlock {
    uvec4 counts;
    uvec4 atlas;
    vec4 disc;
    vec4 target_size;
};

flat in ivec2 v_tile;
flat in int v_hemisphere;
flat in vec3 v_offset;
flat in vec3 v_normal;
flat in vec4 v_edge_a;
flat in vec4 v_edge_b;
flat in float v_radius;

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy) - v_tile;
    int size = int(atlas.x);
    // Points overhang their tile.
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, ivec2(size)))) {
        discard;
    }
    vec3 direction = tile_decode((vec2(texel) + 0.5) / float(size), v_hemisphere == 1);
    float d = length(v_offset);
    float slope = dot(v_normal, direction);
    float t = dot(v_normal, v_offset) / (abs(slope) > 1e-5 ? slope : 1e-5);
    vec3 miss = direction * t - v_offset;
    bool inside = t > 0.0 && dot(miss, miss) <= v_radius * v_radius
        && dot(miss, v_edge_a.xyz) <= v_edge_a.w && dot(miss, v_edge_b.xyz) <= v_edge_b.w;
    // However small or slanted, a surfel covers the texel that its centre falls into.
    ivec2 centre = ivec2(tile_encode(v_offset, v_hemisphere == 1) * float(size));
    bool behind = v_hemisphere == 1 && v_offset.z <= 0.0;
    if (!inside && (behind || texel != centre)) {
        discard;
    }
    t = inside ? t : (t > 0.0 ? clamp(t, d * 0.5, d * 2.0) : d);
    gl_FragDepth = clamp(t * disc.y, 0.0, 0.9999);
}
