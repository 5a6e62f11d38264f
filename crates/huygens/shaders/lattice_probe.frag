// What the light's shadow map holds along each ray of the lattice.
// Input: direction of each ray in light space (w: mip level that covers the ray's cell).
// Output: rgb: mean albedo of the cell (nothing counts as black), a: distance along the ray, m (0: nothing there).

uniform sampler2D s_ray;
uniform highp samplerCube s_depth;
uniform highp samplerCube s_cube_albedo;

layout(std140) uniform PassBlock {
    vec4 extent; // x: farthest distance that the map holds, m; y: texels on a face; z: faces are split in z × z
};

layout(location = 0) out vec4 o_probe;

void main()
{
    vec4 ray = texelFetch(s_ray, ivec2(gl_FragCoord.xy), 0);
    // A ray in the light's plane reads the texels in front of it: those behind it are empty for all but point lights.
    float depth = textureLod(s_depth, vec3(ray.xy, max(ray.z, 1.0 / extent.y)), 0.0).r;
    o_probe = vec4(textureLod(s_cube_albedo, ray.xyz, ray.w).rgb, depth < 1.0 ? depth * extent.x : 0.0);
}
