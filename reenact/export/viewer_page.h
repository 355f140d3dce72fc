// The text of viewer.html, with @TITLE@ and @MODEL@ where a title and a model in base64 belong. Made at build time.
#pragma once

extern const char viewer_page[];
