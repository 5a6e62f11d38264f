// Shadow map (Williams 1978): distance from the light over the farthest that the map holds. Distance rather than
// projected depth, so that a bias in metres means the same everywhere and the lattice can read how deep the scene is.

layout(std140) uniform PassBlock {
    mat4 clip_from_world;
    vec4 origin_ws;
    vec4 axis_ws;
};

in vec3 v_from_light;
in vec4 v_uv;
in vec4 v_color;

void main()
{
    if (material_masked(material_base_color(v_uv, v_color).a)) {
        discard;
    }
    float distance = mix(length(v_from_light), dot(v_from_light, axis_ws.xyz), axis_ws.w);
    gl_FragDepth = clamp(distance * origin_ws.w, 0.0, 1.0);
}
