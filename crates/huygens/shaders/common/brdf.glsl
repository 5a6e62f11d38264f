// The reflection of glTF 2.0, appendix B: Lambert below, GGX above, joined by Schlick's Fresnel term.

// Trowbridge & Reitz 1975: distribution of microfacet normals. The sine comes from the cross product: 1 − cos² has
// too few digits where the lobe is narrow.
float D_GGX(vec3 n, vec3 h, float alpha)
{
    float a2 = alpha * alpha;
    vec3 sine = cross(n, h);
    float f = dot(sine, sine) + dot(n, h) * dot(n, h) * a2;
    return a2 / (PI * f * f);
}

// Heitz 2014: height-correlated Smith masking-shadowing over 4 (n·l)(n·v).
float V_SmithGGXCorrelated(float n_l, float n_v, float alpha)
{
    float a2 = alpha * alpha;
    float v = n_l * sqrt(n_v * n_v * (1.0 - a2) + a2);
    float l = n_v * sqrt(n_l * n_l * (1.0 - a2) + a2);
    return 0.5 / max(v + l, 1e-6);
}

// Schlick 1994.
vec3 F_Schlick(vec3 f0, float f90, float v_h)
{
    return f0 + (vec3(f90) - f0) * pow(clamp(1.0 - v_h, 0.0, 1.0), 5.0);
}

// Half-way between two unit vectors; any if they are opposite.
vec3 half_vector(vec3 l, vec3 v)
{
    vec3 h = l + v;
    return h * inversesqrt(max(dot(h, h), 1e-12));
}

// BRDF, 1/sr, for unit vectors to the light and to the viewer.
vec3 brdf(vec3 base, float metallic, float roughness, float specular, vec3 n, vec3 l, vec3 v)
{
    vec3 h = half_vector(l, v);
    float n_l = max(dot(n, l), 0.0), n_v = max(abs(dot(n, v)), 1e-4);
    float v_h = clamp(dot(v, h), 0.0, 1.0);
    // A mirror has no lobe that a point light could be seen in; this keeps the smallest one finite.
    float alpha = max(roughness * roughness, 1e-3);
    vec3 f0 = mix(vec3(0.04 * specular), base, metallic);
    vec3 F = F_Schlick(f0, mix(specular, 1.0, metallic), v_h);
    vec3 diffuse = base * (1.0 - metallic) / PI;
    return (1.0 - F) * diffuse + F * (D_GGX(n, h, alpha) * V_SmithGGXCorrelated(n_l, n_v, alpha));
}
