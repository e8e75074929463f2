# Five captures in pictures of some 200 to 400 pixels, trained with the preset quick: for scripts that colour them, which
# source this after they set `out`. Captures are looked for in $CNERF_DATA (else ../shared/data), the program is $CNERF
# (else the release build).
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
scenes=${CNERF_DATA:-$root/../shared/data}/scenes
cnerf=${CNERF:-$root/build/release/cnerf}
mkdir -p "$out"

# Folder and options of a capture. The sample's own split holds out views of one side alone.
declare -A folder=([sample]=$out/sample-capture [lego]=$scenes/lego [fox]=$scenes/fox [flower]=$scenes/flower [fruit]=$scenes/fruit)
declare -A options=([sample]='--holdout 5' [lego]='--downscale 2' [fox]='--downscale 4 --holdout 8'
  [flower]='--downscale 8 --holdout 8' [fruit]='--downscale 2 --holdout 8')

train_small() {  # train_small CAPTURE, to $out/CAPTURE unless it is there
  if [ "$1" = sample ] && [ ! -e "${folder[sample]}" ]; then "$cnerf" sample -o "${folder[sample]}" --progress quiet; fi
  if grep -qs '"finished": true' "$out/$1/run.json"; then return; fi
  # shellcheck disable=SC2086  # options are words
  "$cnerf" train "${folder[$1]}" -o "$out/$1" --preset quick ${options[$1]} --overwrite --progress quiet
}
