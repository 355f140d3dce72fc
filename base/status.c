#include "base/status.h"

#include "base/text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static _Thread_local char sentence[512];

enum status fail(enum status status, const char *format, ...)
{
    // Formatted into a buffer first: an argument may be status_message() itself.
    char formatted[sizeof sentence];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(formatted, sizeof formatted, format, arguments);
    va_end(arguments);
    text_make_printable(formatted); // names in it may come from outside
    snprintf(sentence, sizeof sentence, "%s", formatted);
    return status;
}

const char *status_message(void) { return sentence; }

static_assert(sizeof((struct failure *)NULL)->sentence == sizeof sentence, "a kept sentence would be cut");

void failure_keep(struct failure *f, enum status status)
{
    f->status = status;
    memcpy(f->sentence, status == OK ? "" : sentence, status == OK ? 1 : sizeof sentence);
}

enum status failure_restore(const struct failure *f)
{
    return f->status == OK ? OK : fail(f->status, "%s", f->sentence);
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
