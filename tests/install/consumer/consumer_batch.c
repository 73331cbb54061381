/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include <driveid/diagnose.h>

int main(void)
{
    const char *given[] = {"K_t_Nm_A=0.05"};
    char *toml = NULL, message[200] = "";
    if (driveid_new("rigid_axis", given, 1, &toml, message, sizeof message) != DRIVEID_OK) {
        printf("%s\n", message);
        return 1;
    }
    int found = strstr(toml, "rigid_axis") != NULL && strstr(toml, "K_t_Nm_A") != NULL;
    driveid_text_free(toml);
    if (!found)
        return 2;
    toml = NULL;
    return driveid_new("no such structure", NULL, 0, &toml, message, sizeof message) < 0 && message[0] ? 0 : 3;
}
