// Addresses (http://USER:PASSWORD@HOST:PORT/PATH?QUERY) as they may be kept and shown: a password in one is for the
// request alone, never for a file, a page or a sentence that others see.
#pragma once
#include "base/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// Takes USER:PASSWORD@ out of it. Other text stays as it is.
void address_hide_user(char *address);

// The address for sentences: without user and password, and with … for a query, which may be a key; cut to fit.
enum { ADDRESS_SHOWN_BYTES = 256 };
const char *address_shown(const char *address, char out[ADDRESS_SHOWN_BYTES]);

#ifdef __cplusplus
}
#endif
