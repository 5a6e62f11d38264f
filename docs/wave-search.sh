#!/usr/bin/env bash
# The search behind the preset `wave`: every choice of the lattice, one at a time, against the path tracer on the four
# built-in scenes. Prints FLIP for each choice and scene, and the mean, lowest first. Takes about a quarter of an hour
# on two cores. What is rendered stays in the folder given as the first argument (default: a temporary one).
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked
out=${1:-$(mktemp -d)}
mkdir -p "$out"

variants=(
  depth-scene:wave.depth=scene
  absorbed:wave.attenuation=absorbed
  uniform:wave.weighting=uniform
  no-tint:wave.tint=none
  emitted:wave.energy=emitted
  reach-0_8:wave.reach=0.8
  reach-0_9:wave.reach=0.9
  reach-1_0:wave.reach=1
  ratio-1_05:wave.ratio=1.05
  ratio-1_15:wave.ratio=1.15
  ratio-2:wave.ratio=2
  d_min-0_05:gather.d_min=0.05
  d_min-0_1:gather.d_min=0.1
  d_min-0_2:gather.d_min=0.2
  d_min-0_45:gather.d_min=0.45
  first:wave.reach=0.8,wave.ratio=2,wave.energy=emitted,gather.d_min=0.05
)
flags=()
for variant in "${variants[@]}"; do flags+=(--variant "$variant"); done

for scene in cornell column corridor atrium; do
  # A quarter of the rays: it is about where they end and what they carry.
  target/release/huygens compare "builtin:$scene" -o "$out/$scene" --size 128x128 --spp 512 --quiet --preset wave \
    --set wave.delta_theta=9 --set wave.delta_phi=9 --techniques direct,ambient,ism,thesis "${flags[@]}" \
    | tee "$out/$scene.txt" >&2
done

# The second column of the four tables side by side.
awk '
  FNR > 2 && !/^wrote/ { flip[$1] = flip[$1] sprintf("  %.3f", $2); sum[$1] += $2 }
  END { for (name in sum) printf "%-12s%s  %.3f\n", name, flip[name], sum[name] / 4 }
' "$out"/{cornell,column,corridor,atrium}.txt | sort -k6 \
  | sed '1i choice      cornell column corridor atrium mean'
