// Puts the layer that was asked for together and averages it over the frames so far. Indirect radiance is the diffuse
// albedo / π times the irradiance of the VPLs, and what the gather found in the glossy lobe; without that the base
// colour stands for all that a surface reflects, metals too.
// Output: radiance (W/(m² sr)), or albedo, normal, depth (m).

uniform sampler2D s_albedo;
uniform sampler2D s_emission;
uniform sampler2D s_direct;
uniform sampler2D s_irradiance;
uniform sampler2D s_specular;
uniform sampler2D s_previous;
uniform sampler2D s_ambient;

layout(std140) uniform PassBlock {
    uvec4 layer; // x: 0 final, 1 direct, 2 indirect, 3 albedo, 4 normal, 5 depth, 6 ambient visibility; y: dim by it; z: add s_specular
    vec4 blend;  // x: weight of this frame in the average
};

layout(location = 0) out vec4 o_value;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Surface s = read_surface(pixel);
    vec3 albedo = texel_at(s_albedo, pixel, size.zw).rgb;
    vec3 direct = texel_at(s_emission, pixel, size.zw).rgb + texel_at(s_direct, pixel, size.zw).rgb;
    float ambient = layer.y == 1u ? texel_at(s_ambient, pixel, size.zw).r : 1.0;
    bool glossy = layer.z == 1u;
    vec3 indirect = albedo / PI * (glossy ? 1.0 - s.metallic : 1.0) * texel_at(s_irradiance, pixel, size.zw).rgb;
    indirect += glossy ? texel_at(s_specular, pixel, size.zw).rgb : vec3(0.0);
    indirect *= s.occlusion * ambient;
    vec3 value = layer.x == 0u ? direct + indirect
               : layer.x == 1u ? direct
               : layer.x == 2u ? indirect
               : layer.x == 3u ? albedo
               : layer.x == 4u ? s.normal_ws
               : layer.x == 5u ? vec3(s.depth)
               : vec3(ambient);
    value = s.depth > 0.0 ? value : vec3(0.0);
    vec3 before = blend.x < 1.0 ? texel_at(s_previous, pixel, size.zw).rgb : vec3(0.0);
    o_value = vec4(mix(before, value, blend.x), 1.0);
}
