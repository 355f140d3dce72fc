#include "platform/network/address.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

// Where USER:PASSWORD@HOST begins, as libcurl sees it: after SCHEME: and one to three slashes, or after two.
static size_t authority_start(const char *address)
{
    size_t at = 0;
    while (isalnum((unsigned char)address[at]) || (at && address[at] && strchr("+-.", address[at])))
        at++;
    at = at && address[at] == ':' ? at + 1 : 0;
    const size_t slashes = strspn(address + at, "/");
    return slashes >= (at ? 1 : 2) ? at + slashes : strlen(address);
}

void address_hide_user(char *address)
{
    char *begin = address + authority_start(address), *host = begin;
    const char *end = begin + strcspn(begin, "/?#\\");
    for (char *at = begin; at < end; at++)
        if (*at == '@')
            host = at + 1;
    memmove(begin, host, strlen(host) + 1);
}

const char *address_shown(const char *address, char out[ADDRESS_SHOWN_BYTES])
{
    char whole[4096];
    snprintf(whole, sizeof whole, "%s", address); // before it is cut: what is cut off may hold the @
    address_hide_user(whole);
    const size_t from = authority_start(whole), length = strcspn(whole + from, "?") + from;
    const size_t max = ADDRESS_SHOWN_BYTES - 8; // the rest is for the signs behind it
    const size_t shown = length < max ? length : max;
    const char *left_out = whole[length] ? "?…" : "";
    snprintf(out, ADDRESS_SHOWN_BYTES, "%.*s%s", (int)shown, whole, shown < length ? "…" : left_out);
    return out;
}
