// Direct visibility from the shadow map of parallel rays, by percentage closer filtering (Reeves et al. 1987).

uniform highp sampler2DShadow s_shadow;

// As for the cube map (common/shadow_cube.glsl), with texels of one size in metres.
float light_visibility(vec3 position_ws, vec3 normal_ws)
{
    float cosine = -dot(normal_ws, light_axis.xyz);
    float offset = shadow.y * (shadow.z + 1.4143) * sqrt(max(1.0 - cosine * cosine, 0.0)) + shadow.w;
    vec3 uvz = (light_from_world * vec4(position_ws + normal_ws * offset, 1.0)).xyz;
    float lit = 0.0;
    for (int i = 0; i < 16; i++) {
        float r = shadow.z * shadow.x * sqrt((float(i) + 0.5) / 16.0), a = float(i) * 2.39996323;
        lit += texture(s_shadow, vec3(uvz.xy + vec2(cos(a), sin(a)) * r, uvz.z));
    }
    return lit / 16.0;
}
