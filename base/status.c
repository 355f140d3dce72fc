#include "base/status.h"

#include <stdarg.h>
#include <stdio.h>

static _Thread_local char sentence[512];

enum status fail(enum status status, const char *format, ...)
{
    // Formatted aside first: an argument may be status_message() itself.
    char fresh[sizeof sentence];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(fresh, sizeof fresh, format, arguments);
    va_end(arguments);
    snprintf(sentence, sizeof sentence, "%s", fresh);
    return status;
}

const char *status_message(void) { return sentence; }

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
