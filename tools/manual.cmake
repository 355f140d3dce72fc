# A program's man page and its completion for bash, from what the program itself says with --help: so they cannot differ.
#
#   cmake -DPROGRAM=FILE -DOUT=FOLDER [-DVERSION=TEXT] [-DDOC=FOLDER] -P tools/manual.cmake
#
# writes FOLDER/NAME.1 and FOLDER/NAME.bash. DOC: where the guide will lie. tests/system/test_install.c holds that help, page
# and completion agree with what the program takes.

function(ask out)
    execute_process(COMMAND ${CMAKE_COMMAND} -E env COLUMNS=100 ARGP_HELP_FMT=rmargin=96 ${PROGRAM} ${ARGN}
        OUTPUT_VARIABLE said ERROR_VARIABLE error RESULT_VARIABLE code)
    if(NOT code EQUAL 0)
        message(FATAL_ERROR "${PROGRAM} ${ARGN}: ${error}")
    endif()
    set(${out} "${said}" PARENT_SCOPE)
endfunction()

# Text as man's macros want it: no line begins with a dot or a quote, backslashes are kept.
function(roff out text)
    string(REPLACE "\\" "\\e" text "${text}")
    string(REPLACE "-" "\\-" text "${text}")
    string(REGEX REPLACE "(^|\n)([.'])" "\\1\\\\&\\2" text "${text}")
    set(${out} "${text}" PARENT_SCOPE)
endfunction()

# The options in a help text, each once: "--mp4"; and the choices of those that take one of several: "--as=bvh|glb".
function(options_of help options choices)
    set(before "\n(  -[a-zA-Z], |      )") # not where a sentence is broken
    string(REGEX MATCHALL "${before}--[a-z][a-z0-9-]*(=[^ \n]+)?" found "${help}")
    string(REGEX REPLACE "${before}" "" found "${found}")
    set(names)
    set(lists)
    foreach(option ${found})
        string(REGEX REPLACE "=.*" "" option_name ${option})
        list(APPEND names ${option_name})
        if(option MATCHES "=[a-z0-9-]+[|]")
            list(APPEND lists ${option})
        endif()
    endforeach()
    list(REMOVE_DUPLICATES names)
    list(REMOVE_DUPLICATES lists)
    set(${options} "${names}" PARENT_SCOPE)
    set(${choices} "${lists}" PARENT_SCOPE)
endfunction()

# The words of a usage line that choose an action: "rename|delete FILE", or lines "or: PROGRAM COMMAND [OPTION...] list FILE".
function(actions_of help command out)
    set(found)
    if(help MATCHES "\\[OPTION\\.\\.\\.\\] ([a-z]+(\\|[a-z]+)+) ")
        string(REPLACE "|" ";" found "${CMAKE_MATCH_1}")
    endif()
    string(REGEX MATCHALL "or:  ${name} ${command} \\[OPTION\\.\\.\\.\\] [a-z]+ " lines "${help}")
    foreach(line ${lines})
        string(REGEX REPLACE ".*\\] ([a-z]+) $" "\\1" action "${line}")
        list(APPEND found ${action})
    endforeach()
    set(${out} "${found}" PARENT_SCOPE)
endfunction()

get_filename_component(name ${PROGRAM} NAME)
ask(help --help)
string(REGEX REPLACE "^Usage: [^\n]*\n" "" about "${help}") # of a program without commands
string(REGEX MATCH "^[^\n]*" about "${about}")
string(REGEX REPLACE "^${name} |\\.$" "" about "${about}")
string(REGEX MATCH "^Usage: ${name} ([^\n]*)" usage "${help}")
set(usage "${CMAKE_MATCH_1}")
string(REGEX REPLACE "\nUsage: .*" "" help "${help}") # of what is done without a command; that has a section of its own

# The commands: a line each, "  PROGRAM COMMAND  what it does".
string(REGEX MATCHALL "\n  ${name} [a-z]+ " lines "${help}")
set(commands)
foreach(line ${lines})
    string(REGEX REPLACE "\n  ${name} ([a-z]+) " "\\1" command "${line}")
    list(APPEND commands ${command})
endforeach()
set(described ${commands})
if(help MATCHES "${name} FILE")
    list(APPEND described FILE) # what is no command's name
endif()

string(TOUPPER ${name} upper)
string(REPLACE "-" "_" function ${name})
roff(about_text "${about}")
roff(help_text "${help}")
set(page ".TH ${upper} 1 \"\" \"reenact ${VERSION}\" \"Reenact\"\n.SH NAME\n${name} \\- ${about_text}\n")
if(NOT usage)
    set(usage "COMMAND [OPTION...]")
endif()
string(APPEND page ".SH SYNOPSIS\n.B ${name}\n${usage}\n.SH DESCRIPTION\n.nf\n${help_text}.fi\n")
set(options_cases)
set(value_cases)
foreach(command ${described})
    ask(help ${command} --help)
    roff(help_text "${help}")
    string(APPEND page ".SH \"${upper} ${command}\"\n.nf\n${help_text}.fi\n")
    string(REPLACE FILE "*" pattern ${command})
    actions_of("${help}" ${command} actions)
    foreach(action ${actions})
        ask(action_help ${command} ${action} --help)
        if(NOT action_help STREQUAL help)
            roff(help_text "${action_help}")
            string(APPEND page ".SH \"${upper} ${command} ${action}\"\n.nf\n${help_text}.fi\n")
            options_of("${action_help}" options choices)
            list(JOIN options " " options)
            string(APPEND options_cases "    '${command} ${action}') options='${options}' ;;\n")
        endif()
    endforeach()
    options_of("${help}" options choices)
    list(JOIN options " " options)
    list(JOIN actions " " actions)
    string(APPEND options_cases "    ${pattern}\\ *) options='${options}' actions='${actions}' ;;\n")
    foreach(choice ${choices})
        string(REGEX MATCH "^[^=]*" option "${choice}")
        string(REGEX REPLACE "^[^=]*=" "" values "${choice}")
        string(REPLACE "|" " " values "${values}")
        string(APPEND value_cases "    ${pattern}\\ ${option}) values='${values}' ;;\n")
    endforeach()
endforeach()
if(NOT commands) # its arguments are of one kind, listed as "  NAME: what it is"; options go before or after them
    options_of("${help}" own_options choices)
    string(REGEX MATCHALL "\n  [a-z][a-z-]*: " commands "${help}")
    string(REGEX REPLACE "\n  ([a-z-]+): " "\\1" commands "${commands}")
    list(JOIN own_options " " own_options)
    string(APPEND options_cases "    *) options='${own_options}' ;;\n")
endif()
list(JOIN commands " " words)
set(completion [==[
# bash completion for @name@, made from its --help.
_@function@()
{
    local command=${COMP_WORDS[1]} current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}
    local options= actions= values= word file take
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W '@words@ @own_options@ --help --version' -- "$current"))
        return
    fi
    case "$command ${COMP_WORDS[2]}" in
@options_cases@    esac
    # bash makes words of --option=value: the option, =, the value
    [ "$current" = = ] && current=
    [ "$before" = = ] && before=${COMP_WORDS[COMP_CWORD-2]}
    [ -z "$current" ] && [ "${COMP_WORDS[COMP_CWORD]}" = = ] && before=${COMP_WORDS[COMP_CWORD-1]}
    case "$command $before" in
@value_cases@    esac
    if [ -n "$values" ]; then
        COMPREPLY=($(compgen -W "$values" -- "$current"))
    elif [[ $before == --take || $before == --with-take || $before == --reference-take ]]; then
        for word in "${COMP_WORDS[@]:1}"; do # the first recording named, of --with-take and --reference-take the last
            [ -f "$word" ] && [[ -z $file || $before != --take ]] && file=$word
        done
        [ -n "$file" ] && while IFS= read -r take; do
            [[ $take == "$current"* ]] && COMPREPLY+=("$(printf %q "$take")")
        done < <(reenact-capture info --json "$file" 2>/dev/null | sed -n '/"takes"/,${s/^\t*"name":\t"\(.*\)",$/\1/;ta;d;:a;s/\\\(.\)/\1/g;p}')
    elif [[ $current == -* ]]; then
        COMPREPLY=($(compgen -W "$options" -- "$current"))
    elif [ "$COMP_CWORD" -eq 2 ]; then
        COMPREPLY=($(compgen -W "$actions" -- "$current"))
    fi
}
complete -o default -F _@function@ @name@
]==])
string(CONFIGURE "${completion}" completion @ONLY)
if(NOT DOC)
    set(DOC docs)
endif()
roff(guide "${DOC}/guide.md")
string(APPEND page ".SH EXIT STATUS\n0: success; 1: the input is at fault, and a sentence says what; 2: wrong usage.\n")
string(APPEND page ".SH SEE ALSO\nThe guide, ${guide}.\n")
file(WRITE ${OUT}/${name}.1 "${page}")
file(WRITE ${OUT}/${name}.bash "${completion}")
