// Push: a texel that holds nothing takes the coarser level's depth; without such a level both inputs are the same and
// it stays empty.

uniform sampler2D s_fine;
uniform sampler2D s_coarse;

layout(location = 0) out float o_depth;

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(s_fine, texel, 0).r;
    bool filled = depth < 1.0 || textureSize(s_coarse, 0) == textureSize(s_fine, 0);
    o_depth = filled ? depth : texelFetch(s_coarse, texel / 2, 0).r;
}
