// What the test of biflag.exe needs of other programs of Windows. "run FILE PROGRAM ..." leaves the program's exit code in a file.
// "hold FILE MS" has a file open as soon as it is there, for so long, as most programs have: nobody may rename or remove it. "event
// NUMBER" tells each biflag.exe what a console tells: 1 is Ctrl-Break, 2 that it closes. "steer" is a policy of `biflag steer`. As
// avrdude.exe, it writes its arguments into a file, and has a script do the work.
#include <stdio.h>
#include <string.h>
#include <windows.h>
#include <tlhelp32.h>

// Wine kills the Unix process of a program that has ended in Windows if it takes half a second longer, as it does on a busy computer:
// then `wine` ends with 137 instead of the program's exit code.
static int run(const char *name, wchar_t *line) {
    STARTUPINFOW start = {.cb = sizeof start, .dwFlags = STARTF_USESTDHANDLES, .hStdInput = GetStdHandle(STD_INPUT_HANDLE),
                          .hStdOutput = GetStdHandle(STD_OUTPUT_HANDLE), .hStdError = GetStdHandle(STD_ERROR_HANDLE)};
    PROCESS_INFORMATION started;
    DWORD code;
    if (!CreateProcessW(NULL, line, NULL, NULL, TRUE, 0, NULL, NULL, &start, &started))
        return 1;
    WaitForSingleObject(started.hProcess, INFINITE);
    GetExitCodeProcess(started.hProcess, &code);
    FILE *file = fopen(name, "w");
    fprintf(file, "%lu", code);
    fclose(file);
    return 0;
}

static int hold(const char *name, int ms) {
    DWORD all_but_delete = FILE_SHARE_READ | FILE_SHARE_WRITE;
    while (CreateFileA(name, GENERIC_READ, all_but_delete, NULL, OPEN_EXISTING, 0, NULL) == INVALID_HANDLE_VALUE)
        ;
    Sleep(ms);
    return 0;
}

static int event(int number) {
    HANDLE all = CreateToolhelp32Snapshot(TH32CS_SNAPPROCESS, 0);
    PROCESSENTRY32 entry = {.dwSize = sizeof entry};
    // A console starts a thread there in each of its programs, at the same address in all.
    LPTHREAD_START_ROUTINE routine = (LPTHREAD_START_ROUTINE)(void *)GetProcAddress(GetModuleHandleA("kernel32"), "CtrlRoutine");
    int told = 0;
    for (BOOL more = Process32First(all, &entry); more; more = Process32Next(all, &entry)) {
        if (strcmp(entry.szExeFile, "biflag.exe"))
            continue;
        HANDLE process = OpenProcess(PROCESS_ALL_ACCESS, FALSE, entry.th32ProcessID);
        told += CreateRemoteThread(process, NULL, 0, routine, (void *)(ULONG_PTR)number, 0, NULL) != NULL;
    }
    // One that has just ended may still be listed.
    return told > 0 ? 0 : 1;
}

static int steer(void) {
    char line[4096];
    while (fgets(line, sizeof line, stdin)) {
        puts("{\"speeds_rpm\":[50,10]}");
        fflush(stdout);
    }
    return 0;
}

// A program of Unix ends unseen by its parent under Wine, so the script leaves its exit code in a file.
static int avrdude(const char *own) {
    FILE *said = fopen("avrdude.txt", "a");
    fprintf(said, "%s: %s\n", own, GetCommandLineA());
    fclose(said);
    remove("avrdude.code");
    STARTUPINFOA start = {.cb = sizeof start};
    PROCESS_INFORMATION started;
    char *script = getenv("AVRDUDE_SCRIPT");
    if (!script)
        return 0;
    CreateProcessA(script, GetCommandLineA(), NULL, NULL, TRUE, 0, NULL, NULL, &start, &started);
    for (FILE *code; ; Sleep(20)) {
        int number;
        if ((code = fopen("avrdude.code", "r")) && fscanf(code, "%d", &number) == 1)
            return number;
    }
}

int main(int count, char **words) {
    char own[MAX_PATH];
    GetModuleFileNameA(NULL, own, sizeof own);
    if (strstr(own, "avrdude.exe"))
        return avrdude(own);
    if (count > 3 && !strcmp(words[1], "run"))
        return run(words[2], wcschr(wcsstr(GetCommandLineW(), L" run ") + 5, ' ') + 1);
    if (count == 4)
        return hold(words[2], atoi(words[3]));
    return count == 3 ? event(atoi(words[2])) : steer();
}
