# Completion of femxdem in bash, by the program's own help and parameters.
_femxdem() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} program=${COMP_WORDS[0]} verbs=() given found
  for given in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    [[ $given =~ ^[a-z]+$ ]] && verbs+=("$given")
  done
  [[ ${verbs[0]:-} == ve ]] && verbs=("${verbs[@]:0:2}") || verbs=("${verbs[@]:0:1}")
  case $before in
    --set) found=$("$program" parameters 2>/dev/null |
      awk '/^\[/ { gsub(/[][]/, "", $1); section = $1 } /^  [a-z]/ && section { print section "." $1 "=" }') ;;
    --out | --ve) found= ;;
    *) found=$("$program" "${verbs[@]}" --help 2>/dev/null | sed -n '/^Subcommands:/,$ s/^  \([a-z]\{1,\}\) .*/\1/p'
      "$program" "${verbs[@]}" --help 2>/dev/null | sed -n 's/^  \(-.*\)/\1/p' | grep -o -e '--[a-z-]*') ;;
  esac
  if [[ $before == --set ]]; then compopt -o nospace 2>/dev/null; else compopt -o filenames 2>/dev/null; fi
  mapfile -t COMPREPLY < <(
    compgen -W "$found" -- "$word"
    [[ $before == --set || $word == -* || ${verbs[*]} == "" || ${verbs[*]} == ve ]] || compgen -f -- "$word"
  )
}
complete -F _femxdem femxdem
