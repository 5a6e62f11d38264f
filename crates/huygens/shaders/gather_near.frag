// The sum over the near VPLs of a range at every pixel, added to what other ranges gave: see common/near.glsl.
// Inputs: G-buffer, VPL texture, lists of near VPLs, visibility. Outputs: as those of gather.frag.

uniform sampler2D s_previous;
uniform sampler2D s_previous_specular;

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    o_irradiance = texelFetch(s_previous, pixel, 0);
    o_specular = texelFetch(s_previous_specular, pixel, 0);
    Receiver r;
    if (!read_receiver(pixel, r)) {
        return;
    }
    vec3 diffuse = vec3(0.0), specular = vec3(0.0);
    add_near(r, diffuse, specular);
    o_irradiance.rgb += diffuse;
    o_specular.rgb += specular;
}
