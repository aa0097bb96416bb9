/* What Rust's standard library imports of Windows 10's bcryptprimitives.dll, and Debian's wine does not have: random bytes,
   here from advapi32. It lies beside the programs that test the libraries under wine, and is part of no FMU. */
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(PVOID bytes, ULONG count); /* RtlGenRandom */

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T count) {
    return SystemFunction036(bytes, (ULONG)count);
}
