// The primary light's shadow map, with the albedo that the light sees (a reflective shadow map, Dachsbacher &
// Stamminger 2005, without normals and flux): the lattice takes its tint and mean albedo from it.
// Output: linear base colour, alpha 1 where there is a surface.

layout(std140) uniform PassBlock {
    mat4 clip_from_world;
    vec4 origin_ws;
    vec4 axis_ws;
};

in vec3 v_from_light;
in vec4 v_uv;
in vec4 v_color;

layout(location = 0) out vec4 o_albedo;

void main()
{
    vec4 base = material_base_color(v_uv, v_color);
    // The lattice has no use for what lies behind the light's plane (axis_ws.xyz, 0 for a light that has none).
    if (material_masked(base.a) || dot(v_from_light, axis_ws.xyz) < 0.0) {
        discard;
    }
    // An unlit surface reflects nothing.
    o_albedo = vec4(flags.y > 0.5 ? vec3(0.0) : clamp(base.rgb, 0.0, 1.0), 1.0);
    gl_FragDepth = clamp(length(v_from_light) * origin_ws.w, 0.0, 1.0);
}
