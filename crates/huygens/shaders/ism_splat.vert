// A splat of an imperfect shadow map as a point large enough for its disc: see common/ism_splat.glsl.

flat out ivec2 v_tile;    // first texel of the tile
flat out int v_hemisphere;
flat out vec3 v_offset;
flat out vec3 v_normal;
flat out vec4 v_bend;
flat out vec4 v_edge_a;
flat out vec4 v_edge_b;
flat out float v_radius;

void main()
{
    uint id = uint(gl_VertexID), each = counts.x * atlas.z, vpl = counts.z + id / each;
    Vpl v = read_vpl(int(vpl));
    Splat splat;
    vec2 at;
    float texels;
    bool seen = read_splat(vpl, v, id % each, splat, at, texels);
    v_tile = ivec2(int(vpl % atlas.y), int(vpl / atlas.y)) * int(atlas.x);
    v_hemisphere = splat.hemisphere ? 1 : 0;
    v_offset = splat.offset;
    v_normal = splat.normal;
    v_bend = splat.bend;
    v_edge_a = splat.edge_a;
    v_edge_b = splat.edge_b;
    v_radius = splat.radius;
    // Clipped where there is none.
    gl_Position = vec4(seen ? (vec2(v_tile) + at) / target_size.xy * 2.0 - 1.0 : vec2(2.0), 0.0, 1.0);
    gl_PointSize = seen ? min(texels, disc.z) : 1.0;
}
