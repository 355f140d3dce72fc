#include "base/status.h"

#include "base/text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static _Thread_local char sentence[512];

// Takes USER:PASSWORD@ out of every address (SCHEME://USER:PASSWORD@HOST): a sentence is shown to others, and kept in
// logs.
static void hide_passwords(char *text)
{
    for (char *begin = text; (begin = strstr(begin, "://"));) {
        begin += 3;
        const size_t length = strcspn(begin, "/?#\\ \t\r\n'\"");
        char *host = begin;
        for (char *at = begin; at < begin + length; at++)
            if (*at == '@')
                host = at + 1;
        memmove(begin, host, strlen(host) + 1);
    }
}

enum status fail(enum status status, const char *format, ...)
{
    // Formatted into a buffer first: an argument may be status_message() itself.
    char formatted[4 * sizeof sentence]; // what is cut off in the end may say that a password goes before it
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(formatted, sizeof formatted, format, arguments);
    va_end(arguments);
    hide_passwords(formatted);
    snprintf(sentence, sizeof sentence, "%.*s", (int)sizeof sentence - 1, formatted);
    text_make_printable(sentence); // names in it may come from outside
    return status;
}

const char *status_message(void) { return sentence; }

static_assert(sizeof((struct failure *)NULL)->sentence == sizeof sentence, "a kept sentence would be cut");

void failure_keep(struct failure *failure, enum status status)
{
    failure->status = status;
    memcpy(failure->sentence, status == OK ? "" : sentence, status == OK ? 1 : sizeof sentence);
}

enum status failure_restore(const struct failure *failure)
{
    return failure->status == OK ? OK : fail(failure->status, "%s", failure->sentence);
}

const char *status_name(enum status status)
{
    switch (status) {
    case OK: return "OK";
    case NOTHING: return "NOTHING";
    case AMBIGUOUS: return "AMBIGUOUS";
    case ERR_INPUT: return "ERR_INPUT";
    case ERR_IO: return "ERR_IO";
    case ERR_MEMORY: return "ERR_MEMORY";
    case ERR_FORMAT: return "ERR_FORMAT";
    case ERR_CORRUPT: return "ERR_CORRUPT";
    case ERR_EXISTS: return "ERR_EXISTS";
    case ERR_MISSING: return "ERR_MISSING";
    case ERR_ORDER: return "ERR_ORDER";
    case ERR_SOLVER: return "ERR_SOLVER";
    case ERR_DEVICE: return "ERR_DEVICE";
    }
    return "unknown status";
}
