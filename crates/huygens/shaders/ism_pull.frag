// Pull (Ritschel et al. 2008 after Marroquim et al. 2007): half the resolution, the mean of the texels that hold
// something. 1 stands for nothing. Tiles are powers of two, so no block mixes two of them.

uniform sampler2D s_fine;

layout(location = 0) out float o_depth;

void main()
{
    ivec2 first = ivec2(gl_FragCoord.xy) * 2;
    float sum = 0.0, count = 0.0;
    for (int i = 0; i < 4; i++) {
        float depth = texelFetch(s_fine, first + ivec2(i & 1, i >> 1), 0).r;
        sum += depth < 1.0 ? depth : 0.0;
        count += depth < 1.0 ? 1.0 : 0.0;
    }
    o_depth = count > 0.0 ? sum / count : 1.0;
}
