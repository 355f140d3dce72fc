// Any bytes as a ZIP archive: every member is read or refused, and found again by its name.
#include "platform/files/zip_file.h"
#include "tests/fuzz/fuzz.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct zip_file *zip;
    if (fuzz_said(zip_file_open(&zip, fuzz_file("archive.zip", data, size))) != OK) {
        FUZZ_CHECK(!zip);
        return 0;
    }
    for (int64_t i = 0; i < zip_file_count(zip) && i < 20; i++) {
        uint8_t *bytes;
        size_t count;
        const int64_t found = zip_file_find(zip, zip_file_name(zip, i));
        FUZZ_CHECK(found >= 0 && !strcmp(zip_file_name(zip, found), zip_file_name(zip, i)));
        if (fuzz_said(zip_file_read(zip, i, &bytes, &count)) == OK) {
            FUZZ_CHECK(bytes[count] == 0);
            free(bytes);
        }
    }
    zip_file_close(&zip);
    return 0;
}
