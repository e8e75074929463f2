#!/usr/bin/env bash
# Runs the blocks of a document that begin with ```bash run, as written, one after another in an empty folder.
#   run_document.sh DOCUMENT.md CNERF FILM_CLIP
# What a reader brings lies there: `photos`, a small sample capture; `warm.png` and `cold.png`, photographs of its scene in
# colour; `clip.mp4`, an old film of it, for documents that name it. `cnerf` is the program with small settings behind the
# words of the document, so that a block takes seconds.
set -euo pipefail
document=$(realpath "$1") program=$(realpath "$2") film_clip=$(realpath "$3")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

blocks=$(awk '/^```bash run$/ { inside = 1; next } /^```/ { inside = 0 } inside' "$document")
if [ -z "$blocks" ]; then
  echo "$document: no block begins with \`\`\`bash run" >&2
  exit 1
fi

mkdir bin
cat > bin/cnerf << EOF
#!/usr/bin/env bash
words=()  # short forms win over settings
while ((\$#)); do
  case \$1 in
    --resolution) words+=("\$1" 32) && shift ;;
    --frames) words+=("\$1" 20) && shift ;;
    *) words+=("\$1") ;;
  esac
  shift
done
set -- "\${words[@]}"
small=()
add() { for setting in "\$@"; do small+=(--set "\$setting"); done; }
case \${1:-} in
  run | train) add stage1.steps=60 stage1.samples_per_step=4096 stage1.steps_per_box=64 stage1.grid.levels=4 \
                   stage1.grid.log2_rows=12 stage1.grid.finest_resolution=64 render.steps_per_box=64 ;;&
  run | colorize) add stage2.patches=4 stage2.patch_size=32 stage2.rays_per_patch=256 stage2.working_resolution=32 \
                      stage2.purify.opinions=1 stage2.purify.base_images=2 stage2.distill_steps=2 stage2.grid.levels=4 \
                      stage2.grid.log2_rows=12 stage2.grid.finest_resolution=64 colorizer.reference_steps=2 ;;&
  run | bake) add bake.resolution=32 mesh.texture_size=64 mesh.faces=500 ;;&
  run | render) add render.frames=3 render.short_side=32 ;;
esac
exec "$program" "\$@" "\${small[@]}"
EOF
chmod +x bin/cnerf
export PATH="$folder/bin:$PATH"

if grep -qw clip.mp4 <<< "$blocks"; then
  command -v colmap > /dev/null || { echo "no COLMAP, which places the frames of a clip"; exit 77; }
  "$program" sample -o orbit --path orbit --views 80 --width 320 --height 240 --samples-per-pixel 4 --progress quiet
  "$film_clip" orbit clip.mp4 flicker=20 grain=4 views=40
fi
"$program" sample -o photos --views 12 --width 64 --height 48 --samples-per-pixel 1 --progress quiet
cp photos/references/view_001.png warm.png
cp photos/references/view_002.png cold.png

bash -euxo pipefail -c "$blocks"
