// One texel of a splat: see common/ism_splat.glsl. Output: distance over the farthest.

flat in ivec2 v_tile;
flat in int v_hemisphere;
flat in vec3 v_offset;
flat in vec3 v_normal;
flat in vec4 v_bend;
flat in vec4 v_edge_a;
flat in vec4 v_edge_b;
flat in float v_radius;

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy) - v_tile;
    // Points overhang their tile.
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, ivec2(int(atlas.x))))) {
        discard;
    }
    float depth;
    Splat splat = Splat(v_hemisphere == 1, v_offset, v_normal, v_bend, v_edge_a, v_edge_b, v_radius);
    if (!splat_depth(splat, texel, depth)) {
        discard;
    }
    gl_FragDepth = depth;
}
