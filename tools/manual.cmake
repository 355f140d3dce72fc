# A program's man page and its completion for bash, from what the program itself says with --help: so they cannot differ.
#
#   cmake -DPROGRAM=FILE -DOUT=FOLDER [-DVERSION=TEXT] -P tools/manual.cmake
#
# writes FOLDER/NAME.1 and FOLDER/NAME.bash.

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

get_filename_component(name ${PROGRAM} NAME)
ask(help --help)
string(REGEX MATCH "^[^\n]*" about "${help}")
string(REGEX REPLACE "^${name} |\\.$" "" about "${about}")

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
string(APPEND page ".SH SYNOPSIS\n.B ${name}\nCOMMAND [OPTION...]\n.SH DESCRIPTION\n.nf\n${help_text}.fi\n")
set(completion "# bash completion for ${name}, made from its --help.\n_${function}()\n{\n    local options\n")
string(APPEND completion "    case \${COMP_WORDS[1]} in\n")
foreach(command ${described})
    ask(help ${command} --help)
    roff(help_text "${help}")
    string(APPEND page ".SH \"${upper} ${command}\"\n.nf\n${help_text}.fi\n")
    string(REGEX MATCHALL "\n +(-[a-zA-Z], )?--[a-z-]+" found "${help}")
    string(REGEX REPLACE "\n +(-[a-zA-Z], )?" "" options "${found}")
    list(JOIN options " " options)
    string(REPLACE FILE "*" command ${command})
    string(APPEND completion "    ${command}) options='${options}' ;;\n")
endforeach()
list(JOIN commands " " words)
string(APPEND completion "    esac\n"
    "    if [ $COMP_CWORD -eq 1 ]; then\n"
    "        COMPREPLY=($(compgen -W \"${words} --help --version\" -- \"$2\"))\n"
    "    elif [[ $2 == -* ]]; then\n        COMPREPLY=($(compgen -W \"$options\" -- \"$2\"))\n    fi\n}\n"
    "complete -o default -F _${function} ${name}\n")
string(APPEND page ".SH EXIT STATUS\n0: success; 1: the input is at fault, and a sentence says what; 2: wrong usage.\n")
string(APPEND page ".SH SEE ALSO\nThe guide, docs/guide.md.\n")
file(WRITE ${OUT}/${name}.1 "${page}")
file(WRITE ${OUT}/${name}.bash "${completion}")
