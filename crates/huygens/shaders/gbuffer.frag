// Writes what the light passes need of the surface at each pixel (see common/surface.glsl for the packing).
// Outputs: surface (RGBA32UI), albedo (linear base colour), emission (radiance, W/(m² sr); alpha: number of the
// instance).

in vec3 v_from_eye;
in vec3 v_normal_ws;
in vec4 v_tangent_ws;
in vec4 v_uv;
in vec4 v_color;
flat in float v_instance;

layout(location = 0) out uvec4 o_surface;
layout(location = 1) out vec4 o_albedo;
layout(location = 2) out vec4 o_emission;

void main()
{
    // Before the discard: derivatives are undefined after it.
    vec3 dx = dFdx(v_from_eye), dy = dFdy(v_from_eye);
    // Tiny scenes must not vanish in the product.
    vec3 geometric = cross(dx / max(max(abs(dx.x), max(abs(dx.y), abs(dx.z))), 1e-37),
                           dy / max(max(abs(dy.x), max(abs(dy.y), abs(dy.z))), 1e-37));
    float depth = dot(v_from_eye, forward_ws.xyz), pixel_depth = abs(dFdx(depth)) + abs(dFdy(depth));
    vec4 base = material_base_color(v_uv, v_color);
    vec4 metallic_roughness = texture(s_metallic_roughness, material_uv(1, v_uv));
    vec3 tangent_normal = texture(s_normal, material_uv(2, v_uv)).xyz * 2.0 - 1.0;
    float occlusion = texture(s_occlusion, material_uv(3, v_uv)).r;
    vec3 emission = emissive.rgb * texture(s_emissive, material_uv(4, v_uv)).rgb;
    if (material_masked(base.a)) {
        discard;
    }

    vec3 to_eye = mix(-forward_ws.xyz, -v_from_eye, eye_ws.w);
    geometric = dot(geometric, geometric) > 0.0 ? normalize(geometric) : normalize(to_eye);
    geometric = dot(geometric, to_eye) < 0.0 ? -geometric : geometric;

    vec3 normal = normalize(v_normal_ws);
    if (flags.z > 0.5) {
        vec3 tangent = v_tangent_ws.xyz - normal * dot(normal, v_tangent_ws.xyz);
        tangent = dot(tangent, tangent) > 0.0 ? normalize(tangent) : vec3(0.0);
        vec3 bitangent = cross(normal, tangent) * v_tangent_ws.w;
        vec2 xy = tangent_normal.xy * factors.z;
        vec3 bent = tangent * xy.x + bitangent * xy.y + normal * tangent_normal.z;
        normal = dot(bent, bent) > 0.0 ? normalize(bent) : normal;
    }
    // The side that is seen is the side that is lit; single-sided back faces were culled.
    normal = gl_FrontFacing ? normal : -normal;

    // Corners are moved to a grid of parts of pixels, which moves what is between them along the surface. Where the ray
    // through the pixel's middle meets the surface, its position is on it: off it, light from behind would reach it.
    vec2 ray = ((gl_FragCoord.xy * size.zw) * 2.0 - 1.0 + jitter.xy) * unprojection.xy;
    mat3 world_from_view_axes = mat3(world_from_view);
    vec3 along = world_from_view_axes * vec3(ray * unprojection.w, -1.0);
    vec3 off = v_from_eye - world_from_view_axes * vec3(ray * unprojection.z, 0.0);
    float slope = dot(geometric, along);
    float met = abs(slope) > 1e-6 ? dot(geometric, off) / slope : depth;
    // Linear, so that surfaces far away are told apart wherever the near plane is. As interpolated, since faces that
    // share an edge were moved alike; on an outline, where both are as deep, the back is behind the front.
    gl_FragDepth = clamp((gl_FrontFacing ? depth : depth + pixel_depth / 256.0) * jitter.z, 0.0, 1.0);
    depth = clamp(met, depth - pixel_depth, depth + pixel_depth);
    float metallic = factors.x * metallic_roughness.b;
    float roughness = factors.y * metallic_roughness.g;
    float occluded = 1.0 + factors.w * (occlusion - 1.0);
    o_surface = uvec4(floatBitsToUint(depth), pack_pair(oct_encode(normal)), pack_pair(oct_encode(geometric)),
                      pack_four(vec4(roughness, metallic, flags.x, occluded)));
    // An unlit surface shows its base colour as if it shone, and reflects nothing.
    bool unlit = flags.y > 0.5;
    o_albedo = vec4(unlit ? vec3(0.0) : base.rgb, 1.0);
    o_emission = vec4(unlit ? base.rgb : emission, v_instance);
}
