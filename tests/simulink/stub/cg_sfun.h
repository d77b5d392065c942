/* In place of the file at the end of an S-function in generated code: its entry point. */
void S_FUNCTION_NAME(SimStruct *S);
void S_FUNCTION_NAME(SimStruct *S)
{
    mdlInitializeSizes(S);
    mdlInitializeSampleTimes(S);
    mdlInitializeConditions(S);
    mdlOutputs(S, 0);
    mdlUpdate(S, 0);
    mdlTerminate(S);
}
