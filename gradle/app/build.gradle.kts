// The client is one native library, built by Cargo, and there is no Java: what Gradle adds is
// the OpenXR loader, the manifest and the signature.
//
// Needs the NDK (ANDROID_NDK_HOME), `cargo install cargo-ndk` and
// `rustup target add aarch64-linux-android`.

plugins {
    alias(libs.plugins.android.application)
}

val repository: Directory = rootProject.layout.projectDirectory.dir("..")
val cargoLibraries: Provider<Directory> = layout.buildDirectory.dir("cargo")
val loaderLibraries: Provider<Directory> = layout.buildDirectory.dir("openxr")

android {
    namespace = libs.versions.applicationId.get()
    compileSdk = libs.versions.compileSdk.get().toInt()

    defaultConfig {
        applicationId = libs.versions.applicationId.get()
        minSdk = libs.versions.minSdk.get().toInt()
        targetSdk = libs.versions.targetSdk.get().toInt()
        // As Cargo.toml says, and as scripts/apk counts.
        val version = Regex("""(?m)^version = "(\d+)\.(\d+)\.(\d+)"""")
            .find(providers.fileContents(repository.file("Cargo.toml")).asText.get())!!
        versionName = version.groupValues.drop(1).joinToString(".")
        versionCode = version.groupValues.drop(1).fold(0) { code, part -> code * 100 + part.toInt() }
        ndk { abiFilters += "arm64-v8a" }
    }

    // Release builds are signed with the key that the environment names, and not at all without.
    val keystore = providers.environmentVariable("SHADECAST_KEYSTORE")
    if (keystore.isPresent) {
        signingConfigs.create("release") {
            storeFile = file(keystore.get())
            storePassword = providers.environmentVariable("SHADECAST_KEYSTORE_PASSWORD").get()
            keyAlias = providers.environmentVariable("SHADECAST_KEY_ALIAS").get()
            keyPassword = providers.environmentVariable("SHADECAST_KEY_PASSWORD")
                .orElse(storePassword!!).get()
            enableV2Signing = true
            enableV3Signing = true
        }
    }
    buildTypes.named("release") {
        isMinifyEnabled = false
        signingConfig = signingConfigs.findByName("release")
    }

    sourceSets.named("main") {
        jniLibs.srcDirs(cargoLibraries, loaderLibraries)
    }
    // Libraries stay uncompressed and are mapped from the APK.
    packaging.jniLibs.useLegacyPackaging = false
}

val buildClient by tasks.registering(Exec::class) {
    description = "Builds the client for arm64-v8a. Cargo knows what is up to date."
    workingDir(repository)
    // Pages of 16 KiB, which newer devices have.
    environment("CARGO_TARGET_AARCH64_LINUX_ANDROID_RUSTFLAGS", "-Clink-arg=-Wl,-zmax-page-size=16384")
    commandLine(
        "cargo", "ndk", "-t", "arm64-v8a", "--platform", libs.versions.minSdk.get(),
        "-o", cargoLibraries.get().asFile.path,
        "build", "--release", "--locked", "-p", "shadecast-android",
    )
}

// Khronos' AAR holds the loader as a prefab module, for CMake; Cargo loads it at run time, so
// that it is only to be packaged.
val openxr: Configuration by configurations.creating

dependencies {
    openxr(variantOf(libs.openxr.loader) { artifactType("aar") })
}

val unpackLoader by tasks.registering(Copy::class) {
    description = "Takes libopenxr_loader.so out of Khronos' AAR."
    from(provider { openxr.map { zipTree(it) } }) {
        include("prefab/modules/openxr_loader/libs/android.arm64-v8a/libopenxr_loader.so")
        eachFile { path = "arm64-v8a/$name" }
        includeEmptyDirs = false
    }
    into(loaderLibraries)
}

tasks.named("preBuild") { dependsOn(buildClient, unpackLoader) }
