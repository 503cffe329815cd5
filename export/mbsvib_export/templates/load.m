function [plant, mech, worst] = ${function}(file)
%${upper}  Rebuild the system ${system} of ${file} with its names, and check it.
%
%   plant          ss object, SI units and radians, uss of an uncertain plant; a struct where there is no ss
%   mech           mechss object (R2020b and later), else a struct: M q'' + C q' + K q = B u, y = F q + G q' + D u
%   worst          largest relative error of the frequency response against the points kept in the file
%
%   An error beyond ${tolerance} stops with a message. Written by mbsvib.
if nargin < 1
    file = fullfile(fileparts(mfilename('fullpath')), ${text});
end
data = load(file);
worst = 0;
for k = 1:numel(data.check.omega)
    s = 1i * data.check.omega(k);
    found = data.C * ((s * eye(size(data.A, 1)) - data.A) \ data.B) + data.D;
    worst = max([worst; reshape(abs(found - data.check.response(:, :, k)) ./ data.check.scale(:, :, k), [], 1)]);
    if ~isempty(data.mech.F)
        q = (data.mech.K + s * data.mech.C + s^2 * data.mech.M) \ data.mech.B;
        found = (data.mech.F + s * data.mech.G) * q + data.mech.D;
        worst = max([worst; reshape(abs(found - data.check.response(:, :, k)) ./ data.check.scale(:, :, k), [], 1)]);
    end
end
if ~(worst <= ${tolerance})
    error('mbsvib:export', 'The frequency response of %s is off by %.1e; the file is damaged.', file, worst);
end
data = with_names(data);
mech = data.mech;
if exist('OCTAVE_VERSION', 'builtin')
    plant = octave_plant(data);
    return
end
if exist('ss') > 0
    plant = ss(data.A, data.B, data.C, data.D, 'Name', data.Name, 'StateName', data.StateName, ...
        'StateUnit', data.StateUnit, 'InputName', data.InputName, 'InputUnit', data.InputUnit, ...
        'OutputName', data.OutputName, 'OutputUnit', data.OutputUnit);
    if isfield(data, 'uncertain') && exist('ureal') > 0
        plant = uncertain_plant(plant, data.uncertain);
    end
else
    plant = data;
end
if exist('mechss') > 0 && ~isempty(data.mech.F)
    mech = mechss(sparse(mech.M), sparse(mech.C), sparse(mech.K), mech.B, mech.F, mech.G, mech.D);
    mech.Name = data.Name;
    mech.InputName = data.InputName;
    mech.InputUnit = data.InputUnit;
    mech.OutputName = data.OutputName;
    mech.OutputUnit = data.OutputUnit;
end
end

function plant = uncertain_plant(plant, p)
delta = cell(numel(p.Nominal), 1);
for k = 1:numel(delta)
    parameter = ureal(p.Variable{k}, p.Nominal(k), 'Range', p.Range(k, :));
    delta{k} = (parameter - p.Nominal(k)) / p.Half(k) * eye(p.Repetitions(k));
end
count = sum(p.Repetitions) + 1;
inputs = plant.InputName(count:end);
outputs = plant.OutputName(count:end);
plant = lft(blkdiag(delta{:}), plant);
plant.InputName = inputs;
plant.OutputName = outputs;
end

function data = with_names(data)
if ~isfield(data.mbsvib, 'mapped')
    return
end
for k = 1:numel(data.mbsvib.mapped)
    short = data.mbsvib.mapped{k};
    name = native2unicode(reshape(data.mbsvib.original{k}, 1, []), 'UTF-8');
    for key = {'InputName', 'OutputName', 'StateName'}
        data.(key{1})(strcmp(data.(key{1}), short)) = {name};
    end
    data.mech.CoordinateName(strcmp(data.mech.CoordinateName, short)) = {name};
    if strcmp(data.Name, short)
        data.Name = name;
    end
end
end

function plant = octave_plant(data)
plant = data;
try
    pkg('load', 'control');
    plant = ss(data.A, data.B, data.C, data.D, 'stname', data.StateName, 'inname', data.InputName, ...
        'outname', data.OutputName, 'name', data.Name);
catch
    plant = data;
end
end
