/* What Wine 8 lacks: the random numbers of Windows 8 and later. It lies beside the programs that are tested under Wine, and
   is no part of what is shipped. */
#include <stddef.h>

__declspec(dllimport) unsigned char __stdcall SystemFunction036(void *buffer, unsigned long length);

__declspec(dllexport) int __stdcall ProcessPrng(unsigned char *buffer, size_t length)
{
    return SystemFunction036(buffer, (unsigned long)length);
}
