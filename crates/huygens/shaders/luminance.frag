// Sums for the automatic exposure (Reinhard et al. 2002): each output texel sums its block of the picture.
// Output: r: sum of the binary logarithms of luminance, g: pixels counted, b: sum of luminance. Black does not count.

uniform sampler2D s_value;

layout(location = 0) out vec4 o_sum;

void main()
{
    ivec2 size = textureSize(s_value, 0), blocks = ivec2(64);
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 first = at * size / blocks, end = (at + 1) * size / blocks;
    vec3 sum = vec3(0.0);
    for (int y = first.y; y < end.y; y++) {
        for (int x = first.x; x < end.x; x++) {
            float luminance = dot(texelFetch(s_value, ivec2(x, y), 0).rgb, vec3(0.2126, 0.7152, 0.0722));
            luminance = min(luminance, 1e30);
            sum += luminance > 0.0 ? vec3(log2(luminance), 1.0, luminance) : vec3(0.0);
        }
    }
    o_sum = vec4(sum, 1.0);
}
