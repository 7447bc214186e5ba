/* Shared by the kernels: what is exported, and how. */
#ifndef FRONTO_KERNELS_H
#define FRONTO_KERNELS_H

#if defined(_WIN32)
#define FRONTO_API __declspec(dllexport)
#else
#define FRONTO_API __attribute__((visibility("default")))
#endif

#endif
