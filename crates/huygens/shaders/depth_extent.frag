// The farthest depth in the light's shadow map within the hemisphere that the light faces: each output texel takes
// the maximum over its block of texels of one face.
// Output: r: distance, m; 0 where the block holds nothing.

uniform highp samplerCube s_depth;

layout(std140) uniform PassBlock {
    vec4 extent; // x: farthest distance that the map holds, m; y: texels on a face; z: faces are split in z × z
};

layout(location = 0) out vec4 o_farthest;

void main()
{
    int split = int(extent.z), block = int(extent.y) / split;
    ivec2 at = ivec2(gl_FragCoord.xy);
    int face = at.y / split;
    ivec2 first = ivec2(at.x, at.y % split) * block;
    float farthest = 0.0;
    for (int y = 0; y < block; y++) {
        for (int x = 0; x < block; x++) {
            vec3 d = face_direction(face, (vec2(first + ivec2(x, y)) + 0.5) / extent.y * 2.0 - 1.0);
            float depth = textureLod(s_depth, d, 0.0).r;
            farthest = max(farthest, depth < 1.0 && d.z >= 0.0 ? depth : 0.0);
        }
    }
    o_farthest = vec4(farthest * extent.x, 0.0, 0.0, 1.0);
}
