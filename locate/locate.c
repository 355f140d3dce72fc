#include "locate/locate.h"
