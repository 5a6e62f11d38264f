// Imperfect shadow maps, whole: splat, pull and push (Ritschel et al. 2008; see common/ism_splat.glsl, ism_pull.frag and
// ism_push.frag). A workgroup makes a VPL's tile in shared memory, or a block of 64 × 64 texels of a larger tile: as pull
// and push have six levels at most, no block needs another.
// Inputs: VPL texture, surfels. Output: nearest distance over the farthest; 1 where there is nothing.

layout(local_size_x = 256) in;

layout(r16f, binding = 0) uniform writeonly image2D i_depth;

const int BLOCK = 64, THREADS = 256;

// The block, then each level of pull: bits of non-negative floats, whose order is that of the floats.
shared uint depths[BLOCK * BLOCK * 4 / 3 + 1];

const uint NOTHING = 0x3f800000u; // 1.0

void main()
{
    int tile = int(atlas.x), edge = min(tile, BLOCK), blocks = tile / edge, thread = int(gl_LocalInvocationIndex);
    uint vpl = counts.z + gl_WorkGroupID.x;
    ivec2 first = ivec2(int(gl_WorkGroupID.y) % blocks, int(gl_WorkGroupID.y) / blocks) * edge;
    for (int k = thread; k < edge * edge; k += THREADS) {
        depths[k] = NOTHING;
    }
    barrier();

    Vpl v = read_vpl(int(vpl));
    for (uint id = uint(thread); id < counts.x * atlas.z; id += uint(THREADS)) {
        Splat splat;
        vec2 at;
        float texels;
        if (!read_splat(vpl, v, id, splat, at, texels)) {
            continue;
        }
        // Texels whose middle is in the square around the splat.
        ivec2 low = max(ivec2(ceil(at - 0.5 * texels - 0.5)) - first, ivec2(0));
        ivec2 high = min(ivec2(ceil(at + 0.5 * texels - 0.5)) - first, ivec2(edge));
        for (int y = low.y; y < high.y; y++) {
            for (int x = low.x; x < high.x; x++) {
                float depth;
                if (splat_depth(splat, first + ivec2(x, y), depth)) {
                    atomicMin(depths[y * edge + x], floatBitsToUint(depth));
                }
            }
        }
    }
    barrier();

    // Pull: the mean of those of four texels that hold something.
    int levels = int(atlas.w), fine = 0, size = edge;
    for (int level = 0; level < levels; level++) {
        int coarse = fine + size * size, half_size = size / 2;
        for (int k = thread; k < half_size * half_size; k += THREADS) {
            int corner = fine + (k / half_size * size + k % half_size) * 2;
            float sum = 0.0, count = 0.0;
            for (int i = 0; i < 4; i++) {
                uint depth = depths[corner + (i & 1) + (i >> 1) * size];
                sum += depth < NOTHING ? uintBitsToFloat(depth) : 0.0;
                count += depth < NOTHING ? 1.0 : 0.0;
            }
            depths[coarse + k] = count > 0.0 ? floatBitsToUint(sum / count) : NOTHING;
        }
        barrier();
        fine = coarse;
        size = half_size;
    }
    // Push: a texel that holds nothing takes the coarser level's.
    for (int level = levels; level > 0; level--) {
        int coarse = fine, coarse_size = size;
        size *= 2;
        fine -= size * size;
        for (int k = thread; k < size * size; k += THREADS) {
            if (depths[fine + k] == NOTHING) {
                depths[fine + k] = depths[coarse + k / size / 2 * coarse_size + k % size / 2];
            }
        }
        barrier();
    }

    ivec2 corner = ivec2(int(vpl % atlas.y), int(vpl / atlas.y)) * tile + first;
    for (int k = thread; k < edge * edge; k += THREADS) {
        imageStore(i_depth, corner + ivec2(k % edge, k / edge), vec4(uintBitsToFloat(depths[k])));
    }
}
