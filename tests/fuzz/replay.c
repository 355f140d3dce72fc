// Runs a target over files, and over the files of folders: fuzz_X PATH…
#include "platform/files/file.h"
#include "tests/fuzz/fuzz.h"

#include <dirent.h>
#include <stdio.h>
#include <string.h>

static int inputs;

static int replay(const char *path)
{
    uint8_t *bytes;
    size_t count;
    if (file_read(path, &bytes, &count) != OK) {
        fprintf(stderr, "%s\n", status_message());
        return 1;
    }
    uint8_t *exact = malloc(count ? count : 1); // without the 0 behind it, so that reading too far is seen
    if (!exact)
        return 1;
    memcpy(exact, bytes, count);
    free(bytes);
    printf("%s\n", path);
    fflush(stdout);
    LLVMFuzzerTestOneInput(exact, count);
    free(exact);
    inputs++;
    return 0;
}

int main(int argc, char **argv)
{
    int failed = 0;
    for (int i = 1; i < argc; i++) {
        DIR *folder = opendir(argv[i]);
        if (!folder) {
            failed += replay(argv[i]);
            continue;
        }
        for (struct dirent *entry; (entry = readdir(folder));) {
            char path[4096];
            if (entry->d_name[0] == '.')
                continue;
            snprintf(path, sizeof path, "%s/%s", argv[i], entry->d_name);
            failed += replay(path);
        }
        closedir(folder);
    }
    printf("%d inputs\n", inputs);
    return failed || !inputs;
}
