// The scene as a light sees it: object space to the clip space of one face of its shadow map.

layout(std140) uniform ObjectBlock {
    mat4 world_from_object;
    mat4 normal_from_object;
};

layout(std140) uniform PassBlock {
    mat4 clip_from_world;
    vec4 origin_ws; // xyz: position of the light, m; w: 1 / farthest distance that the map holds
    vec4 axis_ws;   // xyz: direction of parallel rays; w: 1 for parallel rays, 0 for a point
};

layout(location = 0) in vec3 a_position;
layout(location = 3) in vec4 a_uv;
layout(location = 4) in vec4 a_color;

out vec3 v_from_light;
out vec4 v_uv;
out vec4 v_color;

void main()
{
    vec4 position_ws = world_from_object * vec4(a_position, 1.0);
    v_from_light = position_ws.xyz - origin_ws.xyz;
    v_uv = a_uv;
    v_color = a_color;
    gl_Position = clip_from_world * position_ws;
}
