#include "capture/recording/recording_reader.h"
enum status recording_verify(const char *path, struct recording_report *out){(void)path;*out=(struct recording_report){0};return fail(ERR_INPUT,"not there yet");}
enum status recording_repair(const char *path, struct recording_report *out){(void)path;*out=(struct recording_report){0};return fail(ERR_INPUT,"not there yet");}
