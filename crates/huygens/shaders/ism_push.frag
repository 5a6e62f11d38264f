// Push: a texel that holds nothing takes the coarser level's depth.

uniform sampler2D s_fine;
uniform sampler2D s_coarse;

layout(location = 0) out float o_depth;

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(s_fine, texel, 0).r;
    o_depth = depth < 1.0 ? depth : texelFetch(s_coarse, texel / 2, 0).r;
}
