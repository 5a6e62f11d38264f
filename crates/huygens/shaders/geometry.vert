// The scene as the camera sees it: object space to clip space.

layout(std140) uniform ObjectBlock {
    mat4 world_from_object;
    mat4 normal_from_object; // inverse transpose, for normals
    vec4 instance;           // x: its number
};

layout(location = 0) in vec3 a_position;
layout(location = 1) in vec3 a_normal;
layout(location = 2) in vec4 a_tangent;
layout(location = 3) in vec4 a_uv;
layout(location = 4) in vec4 a_color;

out vec3 v_from_eye;
out vec3 v_normal_ws;
out vec4 v_tangent_ws;
out vec4 v_uv;
out vec4 v_color;
flat out float v_instance;

void main()
{
    vec4 position_ws = world_from_object * vec4(a_position, 1.0);
    // From the eye, so that derivatives keep their digits far from the origin.
    v_from_eye = position_ws.xyz - eye_ws.xyz;
    v_normal_ws = (normal_from_object * vec4(a_normal, 0.0)).xyz;
    v_tangent_ws = vec4((world_from_object * vec4(a_tangent.xyz, 0.0)).xyz,
                        determinant(mat3(world_from_object)) < 0.0 ? -a_tangent.w : a_tangent.w);
    v_uv = a_uv;
    v_color = a_color;
    v_instance = instance.x;
    gl_Position = clip_from_view * (view_from_world * position_ws);
    gl_Position.xy -= jitter.xy * gl_Position.w;
}
