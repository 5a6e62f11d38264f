#!/usr/bin/env bash
# Makes the README's pictures of the window, on a display without a monitor: needs Xvfb, xdotool and ImageMagick.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --release --locked --package huygens-app
program=$PWD/target/release/huygens images=$PWD/docs/images
scratch=$(mktemp -d)
exec 3<> <(:)
Xvfb -displayfd 3 -screen 0 1280x720x24 -nolisten tcp 2>/dev/null &
server=$!
trap 'kill $viewer $server 2>/dev/null || true; rm -rf "$scratch"' EXIT
read -r number <&3
export DISPLAY=:$number

# Its own home, so that nothing is remembered; few VPLs, so that a software driver has time.
(cd "$scratch" && HOME=$scratch exec "$program" view builtin:column --size 1280x720 --preset balanced --exposure 2 \
  --set wave.delta_theta=10 --set wave.delta_phi=10 --set ism.points=256) &
viewer=$!
window=
until [[ $window ]]; do
  sleep 0.5
  window=$(xdotool search --name 'VPLs$' || true)
done
xdotool windowfocus "$window"

press() { xdotool key "$1"; sleep 1; }
xdotool mousemove 400 600
sleep 40
press g
press k
sleep 2
import -window root "$images/window.png"
press k

# The light goes to the right, down, and back.
frame=0
shoot() { import -window root -resize 640x360 "$scratch/$(printf %03d $frame).png"; frame=$((frame + 1)); }
for key in Right Right Right Right Right Right Down Down Left Left Left Left Left Left Up Up; do
  shoot
  xdotool keydown "$key"; sleep 0.2; xdotool keyup "$key"
  sleep 2
done
convert -delay 25 -loop 0 "$scratch"/*.png +dither -colors 160 -layers optimize "$images/window.gif"
