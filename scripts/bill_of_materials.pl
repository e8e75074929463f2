#!/usr/bin/perl
# Prints a software bill of materials (SPDX 2.3, JSON) of programs: the Debian packages that their shared libraries are of.
#   perl scripts/bill_of_materials.pl FILE...
use strict;
use warnings;
use JSON::PP;
use POSIX qw(strftime);

# The shared libraries that the loader finds for a file, links resolved.
sub libraries_of {
  my ($file) = @_;
  my @found = map { m{=> (/\S+)} ? $1 : () } qx(ldd '$file');
  die "$file: ldd finds no library\n" if !@found;
  return map { chomp(my $real = qx(readlink -f '$_')); $real } @found;
}

# The Debian packages of files: file => {name, version, source}, undefined where a file is not Debian's. Asked for all of
# them at once, since dpkg-query reads all that is installed each time.
sub packages_of {
  my @files = @_;
  my %plain = map { ($_ => s{^/usr/}{/}r) } @files;  # /lib is /usr/lib, and packages may have either
  my $both = join ' ', map { "'$_'" } %plain;
  my (%owner, %package);
  for (qx(dpkg-query -S $both 2> /dev/null)) {
    my ($owner, $file) = m{^([^\s,]+)(?:, \S+)*: (/.*)$} or next;
    $owner{$file =~ s{^/usr/}{/}r} //= $owner;
  }
  my $owners = join ' ', map { "'$_'" } values %owner;
  for (qx(dpkg-query -W -f '\${binary:Package}\t\${Package}\t\${Version}\t\${source:Package}\n' $owners)) {
    chomp;
    my ($owner, $name, $version, $source) = split /\t/;
    $package{$owner} = {name => $name, version => $version, source => $source};
  }
  return map { ($_ => $package{$owner{$plain{$_}} // ''}) } @files;
}

# A package as SPDX describes it.
sub entry_of {
  my ($package, $distribution) = @_;
  my ($name, $version) = @{$package}{qw(name version)};
  (my $id = $name) =~ s/[^A-Za-z0-9.-]/-/g;
  (my $escaped = $version) =~ s/([^A-Za-z0-9.~-])/sprintf '%%%02X', ord $1/ge;
  return {
    SPDXID => "SPDXRef-$id", name => $name, versionInfo => $version, downloadLocation => 'NOASSERTION',
    sourceInfo => "built from the Debian source package $package->{source}", filesAnalyzed => JSON::PP::false,
    licenseConcluded => 'NOASSERTION', licenseDeclared => 'NOASSERTION', copyrightText => 'NOASSERTION',
    externalRefs => [{referenceCategory => 'PACKAGE-MANAGER', referenceType => 'purl',
      referenceLocator => "pkg:deb/debian/$name\@$escaped?distro=$distribution"}],
  };
}

my %packages;
my %libraries = map { $_ => 1 } map { libraries_of($_) } @ARGV;
my %package_of = packages_of(sort keys %libraries);
for my $library (sort keys %libraries) {
  my $package = $package_of{$library} or die "$library is of no Debian package\n";
  $packages{$package->{name}} = $package;
}
my ($distribution) = qx(cat /etc/os-release) =~ /^VERSION_CODENAME=(\w+)/m;
my ($version) = qx('$ARGV[0]' --version) =~ /^cnerf (\S+)/m;
my @entries = map { entry_of($packages{$_}, $distribution) } sort keys %packages;
my $made = strftime '%Y-%m-%dT%H:%M:%SZ', gmtime($ENV{SOURCE_DATE_EPOCH} // time);
my $program = {
  SPDXID => 'SPDXRef-cnerf', name => 'cnerf', versionInfo => $version, downloadLocation => 'NOASSERTION',
  filesAnalyzed => JSON::PP::false, licenseConcluded => 'Apache-2.0', licenseDeclared => 'Apache-2.0',
  copyrightText => 'NOASSERTION',
};
print JSON::PP->new->canonical->pretty->encode({
  spdxVersion => 'SPDX-2.3', dataLicense => 'CC0-1.0', SPDXID => 'SPDXRef-DOCUMENT', name => "cnerf-$version",
  documentNamespace => "urn:cnerf:$version:$distribution:" . time, creationInfo => {created => $made, creators => ['Tool: scripts/bill_of_materials.pl']},
  packages => [$program, @entries],
  relationships => [
    {spdxElementId => 'SPDXRef-DOCUMENT', relationshipType => 'DESCRIBES', relatedSpdxElement => 'SPDXRef-cnerf'},
    map { {spdxElementId => 'SPDXRef-cnerf', relationshipType => 'DYNAMIC_LINK', relatedSpdxElement => $_->{SPDXID}} } @entries,
  ],
});
