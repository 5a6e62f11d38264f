// A cube shadow map: its faces +x, +y, +z above −x, −y, −z, each as a cube map has it. Distance over the farthest in grey;
// white where there is nothing.

uniform highp samplerCube s_depth;

layout(std140) uniform PassBlock {
    vec4 picture; // xy: its size, pixels
    uvec4 tiles;
    uvec4 range;
    vec4 low;
    vec4 scale;
};

layout(location = 0) out vec4 o_color;

void main()
{
    vec2 at = gl_FragCoord.xy / picture.xy * vec2(3.0, 2.0);
    int face = 2 * int(at.x) + (at.y < 1.0 ? 1 : 0);
    float depth = textureLod(s_depth, face_direction(face, fract(at) * 2.0 - 1.0), 0.0).r;
    o_color = vec4(vec3(depth), 1.0);
}
