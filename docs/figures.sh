#!/usr/bin/env bash
# Makes every picture of the README: builds the release binary and renders into docs/images/.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --release --locked --package huygens-app
images=docs/images
mkdir -p "$images"

# figure NAME SCENE OPTION…; four frames, so that edges are smooth.
figure() {
  local name=$1 scene=$2
  shift 2
  target/release/huygens render "builtin:$scene" --output "$images/$name.png" --frames 4 "$@"
}

figure atrium atrium --size 480x270 --exposure -0.25

# Pictures that stand side by side have the same exposure.
small=(--size 320x240)
figure cornell         cornell "${small[@]}" --exposure -1.5
figure cornell-thesis  cornell "${small[@]}" --exposure -1.5 --preset thesis
figure cornell-wave    cornell "${small[@]}" --exposure -1.5 --preset wave
target/release/huygens reference builtin:cornell --output "$images/cornell-reference.png" "${small[@]}" \
  --exposure -1.5 --spp 256

figure column          column "${small[@]}" --exposure 2.5
figure column-direct   column "${small[@]}" --exposure 2.5 --layer direct
figure column-indirect column "${small[@]}" --exposure 2.5 --layer indirect

figure corridor             corridor "${small[@]}" --exposure 1.25
figure corridor-none        corridor "${small[@]}" --exposure 1.25 --layer indirect --set visibility=none
figure corridor-ism         corridor "${small[@]}" --exposure 1.25 --layer indirect --set visibility=ism
figure corridor-shadow-maps corridor "${small[@]}" --exposure 1.25 --layer indirect --set visibility=shadow_maps \
  --set shadow_maps.count=1024

# Where a constant term comes closest: docs/technique.md, the search.
compared=$(mktemp -d)
trap 'rm -rf "$compared"' EXIT
target/release/huygens compare builtin:column --output "$compared" --size 256x256 --spp 512 --preset wave \
  --techniques ambient,ism
for picture in reference ambient ism ambient-flip ism-flip; do
  cp "$compared/$picture.png" "$images/column-compare-$picture.png"
done
