/* Preloaded, it fills what C++ deletes with the number one, and gives nothing back: a reference count that is
 * read there says that this was the last reference, and whoever then calls a destructor calls the address 1. So
 * what elsewhere corrupts the heap now and then ends the process each time. */
#include <stdlib.h>

void _ZdlPvm(void *block, size_t size) /* operator delete(void *, std::size_t) */
{
    int *words = block;
    for (size_t i = 0; block && i < size / sizeof *words; i++)
        words[i] = 1;
}
