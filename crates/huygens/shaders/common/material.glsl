// A material of glTF 2.0 (metallic-roughness) with its five textures. `passes/geometry.rs` mirrors the block.

layout(std140) uniform MaterialBlock {
    vec4 base_color; // linear rgb, alpha
    vec4 emissive;   // rgb: radiance W/(m² sr), a: alpha cutoff (negative: no mask)
    vec4 factors;    // metallic, roughness, normal scale, occlusion strength
    vec4 flags;      // specular factor, unlit, has a normal texture
    vec4 uv_matrix[5];  // columns of the 2×2 part of each texture's transform
    vec4 uv_offset[5];  // xy: its translation, z: set of texture coordinates
};

uniform sampler2D s_base_color;
uniform sampler2D s_metallic_roughness;
uniform sampler2D s_normal;
uniform sampler2D s_occlusion;
uniform sampler2D s_emissive;

// Texture coordinates of texture `i`; `uv` holds both sets.
vec2 material_uv(int i, vec4 uv)
{
    vec2 set = uv_offset[i].z < 0.5 ? uv.xy : uv.zw;
    return uv_matrix[i].xy * set.x + uv_matrix[i].zw * set.y + uv_offset[i].xy;
}

vec4 material_base_color(vec4 uv, vec4 color)
{
    return base_color * color * texture(s_base_color, material_uv(0, uv));
}

// True where the alpha mask leaves nothing.
bool material_masked(float alpha)
{
    return alpha < emissive.a;
}
