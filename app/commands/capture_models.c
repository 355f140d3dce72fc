// reenact-capture models: the pre-trained networks for body points, which no package of ours holds.
#include "app/commands/commands.h"
#include "platform/files/installed.h"

#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    bool *fetch = state->input;
    switch (key) {
    case COMMAND_KEY: *fetch = true; return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// tools/models knows which they are, where they come from, where they go, and what they must be; it says how it ended.
static enum status run_tool(const char *how, int *code)
{
    char path[INSTALLED_PATH_BYTES];
    pid_t tool;
    if (!installed_tool("models", path))
        return fail(ERR_MISSING,
                    "the part that fetches the networks is not installed: it lies in libexec/reenact beside bin");
    char *const words[] = {path, (char *)(uintptr_t)how, NULL};
    const int error = posix_spawn(&tool, path, NULL, NULL, words, environ);
    if (error)
        return fail(ERR_IO, "%s does not start: %s", path, strerror(error));
    while (waitpid(tool, code, 0) < 0)
        if (errno != EINTR)
            return fail(ERR_IO, "%s: %s", path, strerror(errno));
    return OK;
}

int capture_models(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"fetch", COMMAND_KEY, NULL, 0, "fetch those that are missing, and check them", 0},
        {0},
    };
    static const struct argp argp = {
        .options = options,
        .parser = parse_option,
        .doc = "Says whether the networks are there that find body points in colour images, and where they lie."
               "\vThey are MediaPipe's (Apache-2.0), from its npm package: npm, curl or wget fetches 10 MB. Only files "
               "with the known checksums are kept. Without them, depth alone decides."};
    bool fetch = false;
    int code = 0;
    command_parse(&argp, argc, argv, &fetch);
    if (run_tool(fetch ? "--fetch" : "--check", &code) != OK)
        return command_failed(argv[0]);
    return code ? 1 : 0;
}
