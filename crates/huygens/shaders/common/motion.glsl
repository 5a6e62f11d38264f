// Where what a pixel shows was in the frame before, if objects moved.

uniform sampler2D s_emission;
uniform sampler2D s_motion;

void to_before(ivec2 pixel, inout vec3 position, inout vec3 normal, inout vec3 plane)
{
    if (count.z == 1u) {
        int instance = int(texel_at(s_emission, pixel, size.zw).a);
        ivec2 row = ivec2((instance & 255) * 4, instance >> 8);
        mat4 motion = mat4(texelFetch(s_motion, row, 0), texelFetch(s_motion, row + ivec2(1, 0), 0),
                           texelFetch(s_motion, row + ivec2(2, 0), 0), texelFetch(s_motion, row + ivec2(3, 0), 0));
        position = (motion * vec4(position, 1.0)).xyz;
        normal = normalize(mat3(motion) * normal);
        plane = normalize(mat3(motion) * plane);
    }
}
